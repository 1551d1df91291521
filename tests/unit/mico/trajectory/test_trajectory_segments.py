"""What becomes of movements that are recorded."""

from cosmic.mico.core.motion.messages import MovementBegun
from cosmic.mico.core.motion.orders import Jog, Motion, MoveTo, Reference, Step
from cosmic.mico.core.trajectory.model import StartPosition, Statement
from cosmic.mico.core.trajectory.segments import SegmentBuilder
from cosmic.mico.core.trajectory.writer import statement_lines


class Recording:
    """A builder with a platform that stands where the test says."""

    def __init__(self, *, timed: bool = False, zero: dict[str, float] | None = None) -> None:
        self.lines: list[str] = []
        self.resting: tuple[str, ...] = ()
        self.at = {"x": 0.0, "y": 0.0, "gripper": 30.0}
        self._builder = SegmentBuilder(
            self._take,
            lambda text: self.lines.append(f"# {text}"),
            begin_s=10.0,
            timed=timed,
            zero=zero or {},
        )

    def _take(self, found: Statement | tuple[str, StartPosition]) -> None:
        if isinstance(found, tuple):
            self.lines.append(f"start {found[0]} {found[1].value:g}")
        else:
            self.lines += statement_lines(found)

    def begin(self, name: str, motion: Motion, time_s: float, hertz: int | None = None) -> None:
        target = motion.target if isinstance(motion, MoveTo) else None
        event = MovementBegun(name, motion, self.at[name], target, "um", time_s, "script")
        self._builder.begun(
            event,
            dict(self.at),
            sensed=name != "gripper",
            frequency_hz=hertz,
            resting=self.resting,
        )

    def go(self, name: str, target: float, time_s: float) -> None:
        self.begin(name, MoveTo(target, "um"), time_s)

    def end(self, name: str, position: float, time_s: float, *, well: bool = True) -> None:
        self.at[name] = position
        self._builder.ended(name, dict(self.at), time_s, well=well)

    def idle(self, time_s: float) -> None:
        self._builder.idle(time_s)

    def close(self, time_s: float) -> list[str]:
        self._builder.close(dict(self.at), time_s)
        return self.lines


def test_movements_one_after_the_other_are_lines_one_after_the_other() -> None:
    record = Recording()
    record.go("x", 100.0, 11.0)
    record.end("x", 99.9, 12.0)
    record.go("y", 50.0, 13.0)
    record.end("y", 50.1, 14.0)
    record.go("x", 200.0, 15.0)
    record.end("x", 200.2, 16.0)
    assert record.close(17.0) == [
        "start x 0", "x to 100 um", "start y 0", "y to 50 um", "x to 200 um",
    ]  # fmt: skip


def test_a_movement_is_written_soon_after_its_end_without_waiting_for_the_next() -> None:
    record = Recording()
    record.go("x", 100.0, 11.0)
    record.idle(11.5)
    record.end("x", 100.0, 12.0)
    record.idle(12.05)
    assert record.lines == ["start x 0"]
    record.idle(12.5)
    assert record.lines == ["start x 0", "x to 100 um"]


def test_movements_begun_at_once_are_a_block() -> None:
    record = Recording(timed=True)
    record.go("x", 100.0, 11.0)
    record.go("y", 50.0, 11.001)
    record.end("y", 50.0, 12.0)
    record.end("x", 100.0, 13.0)
    assert record.close(14.0)[-4:] == ["t=1 s together", "    x to 100 um", "    y to 50 um", "end"]


def test_a_movement_begun_while_another_runs_cuts_it_there() -> None:
    record = Recording()
    record.go("x", 1000.0, 11.0)
    record.at["x"] = 400.0
    record.go("y", 50.0, 12.0)
    record.end("y", 50.0, 13.0)
    record.end("x", 1000.0, 14.0)
    assert record.close(15.0) == [
        "start x 0", "x to 400 um", "start y 0",
        "together", "    x to 1000 um", "    y to 50 um", "end",
    ]  # fmt: skip


def test_a_movement_that_was_stopped_or_replaced_is_what_it_reached() -> None:
    record = Recording()
    record.go("x", 1000.0, 11.0)
    record.end("x", 300.0, 12.0, well=False)
    record.go("x", -100.0, 12.01)
    record.end("x", -100.0, 13.0)
    assert record.close(14.0) == ["start x 0", "x to 300 um", "x to -100 um"]


def test_a_movement_that_only_goes_further_the_same_way_is_one_line() -> None:
    record = Recording()
    for number in range(50):
        record.go("x", 100.0 + number, 11.0 + 0.01 * number)
        record.end("x", 2.0 * number, 11.01 + 0.01 * number, well=False)
    record.go("x", 200.0, 11.51)
    record.end("x", 200.0, 12.0)
    assert record.close(13.0) == ["start x 0", "x to 200 um"]


def test_two_axes_steered_at_once_are_cut_in_time_and_not_at_every_order() -> None:
    record = Recording()
    for number in range(100):
        now_s = 11.0 + 0.01 * number
        for name in ("x", "y"):
            if number:
                record.end(name, 10.0 * number, now_s, well=False)
            record.go(name, 10.0 * number + 20.0, now_s)
    record.end("x", 1000.0, 12.1, well=False)
    record.end("y", 1000.0, 12.1, well=False)
    blocks = record.close(13.0).count("together")
    assert 3 <= blocks <= 8


def test_a_jog_is_the_position_it_reached_and_with_timing_its_speed() -> None:
    record = Recording(timed=True)
    record.begin("x", Jog(1, 200.0), 11.0)
    record.end("x", 431.5, 13.0)
    record.go("x", 0.0, 14.0)
    record.end("x", 0.0, 15.0)
    assert record.close(16.0) == [
        "start x 0", "speed x 200 um/s", "t=1 s x to 431.5 um", "speed x usual", "t=4 s x to 0 um",
    ]  # fmt: skip


def test_gripper_steps_are_steps_and_those_cut_short_are_those_made() -> None:
    record = Recording()
    record.begin("gripper", Step(-500, 80.0, 1000), 11.0)
    record.end("gripper", -370.0, 11.5)
    record.begin("gripper", Step(1000, 100.0, 1000), 12.0)
    record.end("gripper", -170.0, 12.25, well=False)
    record.begin("gripper", Jog(-1, 200.0), 13.0)
    record.end("gripper", -270.0, 13.5)
    assert record.close(16.0) == [
        "steps gripper -500 80 V 1000 Hz", "steps gripper 250 100 V 1000 Hz",
        "steps gripper -100 200 Hz",
    ]  # fmt: skip


def test_a_reference_run_is_reported_and_where_it_ended() -> None:
    record = Recording()
    record.begin("x", Reference(), 11.0)
    record.end("x", 512.0, 12.0)
    lines = record.close(13.0)
    assert lines[1].startswith("# x: finding a reference is not repeated")
    assert lines[2] == "x to 512 um"


def test_positions_count_from_a_pose() -> None:
    record = Recording(zero={"x": 1000.0})
    record.at["x"] = 1005.0
    record.go("x", 1100.0, 11.0)
    record.end("x", 1100.0, 12.0)
    assert record.close(13.0) == ["start x 5", "x to 100 um"]


def test_what_still_moves_at_the_end_is_written_as_far_as_it_got() -> None:
    record = Recording()
    record.go("x", 1000.0, 11.0)
    record.at["x"] = 640.0
    assert record.close(12.0) == ["start x 0", "x to 640 um"]


def test_an_end_that_is_reported_late_cuts_nothing() -> None:
    record = Recording()
    record.go("x", 100.0, 11.0)
    record.at["x"] = 99.9
    record.resting = ("x",)
    record.go("y", 50.0, 12.0)
    record.end("x", 99.9, 12.001)
    record.end("y", 50.0, 13.0)
    assert record.close(14.0) == ["start x 0", "x to 100 um", "start y 0", "y to 50 um"]
