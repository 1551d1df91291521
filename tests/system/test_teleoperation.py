"""A hand steers the twin: a gamepad through SDL, a haptic device that feels the fibre."""

from collections.abc import Iterator
from contextlib import contextmanager
from itertools import cycle

import pytest

import cosmic
from cosmic.app.rig import Rig
from cosmic.daqco.core.scale import Scale
from cosmic.frame.clock import WALL
from cosmic.mico.core.teleoperation.state import TeleoperationPhase as Phase
from cosmic.mico.hw.interface import Channel
from cosmic.testing.virtual_gamepad import VirtualGamepad
from system.simulated_platform import wait_until

LEFT_X = Channel(0, 0)


class Watched:
    """Notes when the simulated controller is told to move and to stop."""

    def __init__(self, rig: Rig) -> None:
        self.moves: list[tuple[float, Channel]] = []
        self.stops: list[tuple[float, Channel]] = []
        controller = rig.mico.application.manager.controller
        self._note(controller, "move_to", self.moves)
        self._note(controller, "stop", self.stops)

    @staticmethod
    def _note(controller, name, notes) -> None:
        real = getattr(controller, name)

        def noted(channel, *args, **kwargs):
            notes.append((WALL.now_s(), channel))
            return real(channel, *args, **kwargs)

        setattr(controller, name, noted)

    def delay_s(self, since_s: float) -> float:
        wait_until(lambda: any(when >= since_s for when, _ in self.stops))
        return next(when for when, channel in self.stops if when >= since_s) - since_s


@contextmanager
def steered() -> Iterator[tuple[Rig, Watched, VirtualGamepad]]:
    with cosmic.connect(applications=("mico",)) as rig, VirtualGamepad() as pad:
        watched = Watched(rig)
        teleoperation = rig.mico.teleoperation
        assert pad.key in [info.key for info in teleoperation.devices()]
        teleoperation.start(pad.key, "left assembly")
        wait_until(lambda: teleoperation.state.phase is Phase.ARMED)
        yield rig, watched, pad
        teleoperation.stop()


def test_a_gamepad_moves_the_assembly_and_each_kind_of_loss_stops_it_in_time():
    with steered() as (rig, watched, pad):
        teleoperation, axis = rig.mico.teleoperation, rig.mico["left.x"]

        def push() -> None:
            pad.push("left_x", 0.0)
            wait_until(lambda: teleoperation.state.phase is Phase.ARMED)
            before = len(watched.moves)
            pad.push("left_x", 1.0)
            wait_until(lambda: len(watched.moves) > before + 5)

        def stands() -> None:
            wait_until(lambda: not axis.details.in_motion)
            place = axis.position_um
            began_s = WALL.now_s()
            wait_until(lambda: WALL.now_s() > began_s + 0.15)
            assert axis.position_um == pytest.approx(place, abs=0.5)

        push()
        assert axis.position_um > 0.5
        begun_s = WALL.now_s()
        pad.push("left_x", 0.0)
        assert watched.delay_s(begun_s) < 0.1
        stands()

        push()
        begun_s = WALL.now_s()
        teleoperation.set_focus(False)
        assert watched.delay_s(begun_s) < 0.1
        stands()
        teleoperation.set_focus(True)

        push()
        begun_s = WALL.now_s()
        pad.press("b")
        assert watched.delay_s(begun_s) < 0.1
        stands()
        assert rig.stopped == "button b of Virtual Controller"
        pad.press("b", down=False)
        rig.reset_stop()
        teleoperation.start(pad.key, "left assembly")

        push()
        begun_s = WALL.now_s()
        pad.unplug()
        assert watched.delay_s(begun_s) < 0.1
        stands()
        assert teleoperation.state.words == "stopped: unplugged"


def test_an_obstacle_slows_steering_down_and_is_shown_not_hit():
    with steered() as (rig, watched, pad):
        teleoperation, axis = rig.mico.teleoperation, rig.mico["left.z"]
        axis.move_to(-1440.0)
        before = len(watched.moves)
        began_s = WALL.now_s()
        deflections = cycle((-1.0, -0.99))  # no hand is quite still

        def refused() -> bool:
            pad.push("right_y", next(deflections))
            return bool(teleoperation.state.refused)

        wait_until(refused, timeout_s=40.0)
        assert "left" in teleoperation.state.refused["left.z"]
        assert WALL.now_s() - began_s > 60.0 / 200.0, "it was slowed down on the way"
        assert len(watched.moves) > before + 10
        assert 0.0 < rig.mico.clearance().distance_um < 30.0
        assert teleoperation.state.phase is Phase.STEERING, "refused is not fatal"
        pad.push("right_y", 1.0)
        wait_until(lambda: axis.position_um > -1470.0, timeout_s=20.0)
        assert teleoperation.state.refused == {}


def test_the_operator_feels_the_fibre_that_the_probe_pushes_and_cannot_push_too_hard():
    with cosmic.connect(applications=("mico", "daqco")) as rig:
        mico, teleoperation = rig.mico, rig.mico.teleoperation
        for target in ({"left.x": 3600.0}, {"left.z": -810.0}, {"probe.y": -4950.0}):
            mico.move(target)
        haptic = teleoperation.sources.haptics.haptic
        teleoperation.start("haptic:sim", "probe, haptic")
        wait_until(lambda: teleoperation.state.phase in (Phase.ARMED, Phase.STEERING))
        felt = haptic.felt_n["y"]
        haptic.move_hand(y=-0.6)
        wait_until(lambda: abs(rig.daqco.latest()["force"]) > 20.0, timeout_s=10.0)
        wait_until(lambda: abs(haptic.felt_n["y"] - felt) > 0.1)
        assert teleoperation.state.feedback_hz > 50.0
        wait_until(lambda: teleoperation.state.inputs.axes["y"] > -0.5)  # the fibre pushes back
        haptic.move_hand(y=-1.0)
        wait_until(lambda: teleoperation.state.slowed < 0.5, timeout_s=10.0)
        began_s = WALL.now_s()
        wait_until(lambda: WALL.now_s() > began_s + 0.5)
        assert abs(rig.daqco.latest()["force"]) < 150.0
        assert rig.stopped is None
        haptic.move_hand(y=0.5)
        wait_until(lambda: abs(rig.daqco.latest()["force"]) < 20.0, timeout_s=10.0)


def test_the_force_channel_is_not_renamed_while_it_is_felt_and_its_lack_is_reported(caplog):
    with cosmic.connect(applications=("mico", "daqco")) as rig, VirtualGamepad() as pad:
        teleoperation, daqco = rig.mico.teleoperation, rig.daqco
        daqco.disarm_limit("force")
        before = daqco.settings
        renamed = before.model_copy(
            update={
                "limit": (),
                "channel": tuple(
                    each.model_copy(update={"name": "push"}) if each.name == "force" else each
                    for each in before.channel
                ),
            }
        )
        teleoperation.start(pad.key, "left assembly")
        with pytest.raises(cosmic.NotAvailable, match=r"channel force.*Stop steering first"):
            daqco.apply(renamed)
        teleoperation.stop()
        daqco.apply(renamed)
        warnings = [each.getMessage() for each in caplog.records if each.levelname == "WARNING"]
        assert any("force feedback needs the channel force" in each for each in warnings)
        with pytest.raises(cosmic.NotAvailable, match="force feedback needs the channel force"):
            teleoperation.start(pad.key, "left assembly")
        daqco.apply(before)
        teleoperation.start(pad.key, "left assembly")
        teleoperation.stop()


def test_a_channel_that_measures_no_force_and_a_board_that_is_lost_let_nothing_go_on():
    with cosmic.connect(applications=("mico", "daqco")) as rig, VirtualGamepad() as pad:
        teleoperation, daqco = rig.mico.teleoperation, rig.daqco
        daqco.disarm_limit("force")
        before = daqco.scales["force"]
        teleoperation.start(pad.key, "left assembly")
        with pytest.raises(cosmic.NotAvailable, match=r"in one of .*; it is in V.*Stop steering"):
            daqco.set_scale("force", Scale("raw", "V"))
        teleoperation.stop()
        daqco.set_scale("force", Scale("raw", "V"))
        with pytest.raises(cosmic.NotAvailable, match="needs the channel force in one of"):
            teleoperation.start(pad.key, "left assembly")
        daqco.set_scale("force", before)
        teleoperation.start(pad.key, "left assembly")
        wait_until(lambda: teleoperation.state.feedback_hz > 0.0)  # samples come
        assert teleoperation.state.slowed == 1.0
        daqco.application.library.faults.inject("unplugged", board="Dev1")
        wait_until(lambda: not daqco.running)
        WALL.sleep(0.3)
        assert teleoperation.state.slowed == 0.0
        teleoperation.stop()
        teleoperation.start(pad.key, "left assembly")
        WALL.sleep(0.3)
        assert teleoperation.state.slowed == 1.0, "begun without a force, which is seen"
        daqco.application.library.faults.clear()
