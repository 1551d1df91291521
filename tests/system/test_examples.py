"""Each example shows what its page says it shows."""

import re
import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def said(capsys: pytest.CaptureFixture[str], request: pytest.FixtureRequest) -> str:
    """What the example named by the parameter prints."""
    runpy.run_path(str(ROOT / "examples" / request.param), run_name="__main__")
    return capsys.readouterr().out


def example(name: str) -> pytest.MarkDecorator:
    return pytest.mark.parametrize("said", [name], indirect=True)


@example("first_session.py")
def test_the_first_session_moves_is_refused_stops_and_goes_on(said: str) -> None:
    lines = said.splitlines()
    steps = [line for line in lines if "%" in line]
    assert "referencing left.z, right.z" in steps[0]
    assert "100%" in steps[-1]
    assert "may left.x go to 500 um? allowed" in lines
    assert any(line.startswith("refused, LIMIT: left.x: target 9000.0") for line in lines)
    assert any(line.startswith("refused, STOPPED: left.x") for line in lines)
    stood = next(line for line in lines if line.startswith("it stands at"))
    assert 100.0 < float(stood.split()[3]) < 4900.0, "it was not stopped on its way"
    assert lines[-1] == "closed: everything stopped, the hold released"


@example("scan_positions.py")
def test_the_scan_reaches_every_place(said: str) -> None:
    head, *rows = said.splitlines()
    assert head == "x_um,y_um,x_reached_um,y_reached_um"
    assert len(rows) == 12
    for row in rows:
        x_um, y_um, x_reached_um, y_reached_um = map(float, row.split(","))
        assert (x_reached_um, y_reached_um) == pytest.approx((x_um, y_um), abs=1.0)


@example("jog.py")
def test_jogging_ends_by_letting_go_and_by_the_dead_man(said: str) -> None:
    held_um, let_go_um, dead_man_um = (float(line.split()[-2]) for line in said.splitlines())
    assert 50.0 < held_um <= let_go_um < 600.0
    assert let_go_um - 500.0 < dead_man_um < let_go_um


@example("watch_positions.py")
def test_watching_hears_of_both_axes_on_their_way(said: str) -> None:
    lines = said.splitlines()
    for name in ("left.x", "right.y"):
        ways = [abs(float(line.split()[1])) for line in lines if line.startswith(name)]
        assert len(ways) > 3
        assert ways[0] < 400.0 < ways[-1]


@example("inject_fault.py")
def test_a_lost_cable_costs_its_own_axes_until_the_rescan(said: str) -> None:
    assert "left.x is UNKNOWN; right.x is OK" in said
    assert "all motion is stopped: right.x: motion is stopped" in said
    assert said.splitlines()[-1] == "after the rescan left.x is OK"


@example("simulated_library.py")
def test_the_library_is_driven_through_its_c_functions(said: str) -> None:
    where, refused = said.splitlines()
    assert float(where.split()[-2]) == pytest.approx(1500.0, abs=0.5)
    assert "131" in refused


@example("positioner_type.py")
def test_a_new_type_refuses_what_it_does_not_know(said: str) -> None:
    reached, refused = said.splitlines()
    assert float(reached.split()[-1]) == pytest.approx(30.0, abs=0.01)
    assert refused.startswith("WRONG_KIND: table.rotation")


@example("measure_force.py")
def test_a_force_is_measured_and_a_limit_stops_the_push(said: str) -> None:
    numbers = {line.split(":")[0]: re.findall(r"[\d.]+", line) for line in said.splitlines()}
    assert 80.0 < float(numbers["force at the end"][0]) < 178.0
    assert "1000 Hz, complete: True" in said
    assert said.count("uN/um") == 1
    assert 1.0 < float(numbers["stiffness"][0]) < 4.0
    assert "stopped: stopped: force reached 14" in said
    assert "crossed: True" in said
    assert float(numbers["crossed"][-1]) < 500.0


@pytest.mark.slow  # the tutorial that shows it runs as a test
@example("look_at_a_fibre.py")
def test_a_fibre_is_looked_at_measured_and_recorded(said: str) -> None:
    numbers = {line.split(":")[0]: re.findall(r"-?[\d.]+", line) for line in said.splitlines()}
    assert float(numbers["length"][0]) == pytest.approx(1200.0, rel=0.005)
    assert "certain True" in said
    assert float(numbers["right"][0]) == pytest.approx(2.2, rel=0.003)
    ends = sorted(float(each) for each in numbers["ends"])
    assert ends == pytest.approx([-371.2, -227.2, 19.8, 790.9], abs=5.0)
    assert "recorded: True, 1600 x 1200 px" in said


@example("hold_a_force.py")
def test_a_force_is_held_changed_and_let_go(said: str) -> None:
    held, stiffness, lower, period, ended, limit = said.splitlines()
    assert float(held.split()[1]) == pytest.approx(50.0, abs=2.5)
    assert 1.0 < float(stiffness.split()[1]) < 4.0
    assert float(lower.split()[1]) == pytest.approx(25.0, abs=2.0)
    assert period.startswith("period: ")
    assert ended == "ended: asked to"
    assert "travel" in limit


@example("write_a_procedure.py")
def test_a_procedure_of_ones_own_goes_from_point_to_point(said: str) -> None:
    lines = said.splitlines()
    assert lines[:4] == ["bring near: done", "touch: done", "push: done", "draw back: done"]
    found = [float(line.split()[3]) for line in lines if line.startswith("at ")]
    assert len(found) == 3
    assert found == sorted(found, reverse=True), "further out a fibre gives way more easily"
    assert "touch: 3 times" in said


@example("initialise.py")
def test_a_cold_platform_is_initialised_step_by_step(said: str) -> None:
    lines = said.splitlines()
    assert lines[0] == "at power-up 0 of 9 positions are known"
    assert lines[1].startswith("refused: left.x: its position is unknown")
    assert "after initialising 9 of 9 positions are known" in lines
    again = lines[lines.index("once more, skipping what is known:") :]
    assert not any("referencing" in line for line in again[:-1])
    assert lines[-1].endswith("To do: reset the stop, then initialise again")


@example("scan_with_force.py")
def test_a_plan_scans_the_force_keeps_images_and_is_refused_a_collision(said: str) -> None:
    lines = said.splitlines()
    assert lines[:2] == ["push: allowed", "into the probe: COLLISION, left_jaw_a and probe_tip"]
    forces_un = [float(line.split()[1]) for line in lines[3:12]]
    assert max(forces_un[:3]) < 3.0 and forces_un[3:] == sorted(forces_un[3:])
    assert 80.0 < forces_un[-1] < 178.0
    assert 1.0 < float(lines[12].split()[1]) < 4.0
    assert "images: 9" in lines
    assert lines[-1].startswith("the plan failed: left.x: left_jaw_a would come within")


@example("steer_with_a_gamepad.py")
def test_a_recorded_hand_steers_as_a_gamepad_does(said: str) -> None:
    lines = said.splitlines()
    words = [line.split("  ")[0] for line in lines[:-4]]
    assert words[:3] == ["let go of the sticks", "armed", "steering"]
    assert lines[-4] == "stopped: unplugged"
    numbers = [float(line.split()[-2]) for line in lines[-3:]]
    assert numbers[0] == 200.0
    assert 20.0 < numbers[1] < 260.0
    assert 10.0 < numbers[2] < 120.0


@example("play_a_waveform.py")
def test_an_output_gives_a_value_and_a_ramp_and_is_refused_while_stopped(said: str) -> None:
    lines = said.splitlines()
    assert lines[:2] == ["piezo gives 2", "lamp gives 1"]
    assert lines[2].startswith("refused: output piezo: 6 V asked; its limits are 0 to 5 V")
    assert lines[3] == "the ramp ends at 4.0 V"
    assert lines[4].startswith("refused: output piezo: outputs are stopped")


@example("camera_on_the_sample_clock.py")
def test_an_image_and_the_force_of_its_sample_are_found(said: str) -> None:
    found = re.fullmatch(r"the image was taken at sample (\d+), at (\S+) uN", said.strip())
    assert found is not None
    assert int(found[1]) % 100 == 0
    assert abs(float(found[2])) < 50.0


@example("two_makes.py")
def test_an_axis_of_each_make_stands_where_it_was_sent(said: str) -> None:
    assert re.search(r"left\.x stands at -\d", said)
    assert re.search(r"probe\.x stands at -\d", said)
