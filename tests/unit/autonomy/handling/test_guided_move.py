"""A movement whose aim is corrected by images while it goes on."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from cosmic.autonomy.handling.guided_move import (
    LAG_S,
    LOST_AFTER,
    OUT_OF_SIGHT,
    REST_S,
    STRAYED,
    Aim,
    AimLimits,
    GuidedMove,
)
from cosmic.autonomy.handling.retrying_move import RetryingMove
from cosmic.autonomy.handling.settings import GraspSettings
from cosmic.autonomy.procedures.operation import OperationFailed
from cosmic.frame.clock import ManualClock
from cosmic.frame.errors import DeviceTimeout, MoveCancelled, MoveRefused, StoppedError
from cosmic.frame.operation import Operation
from cosmic.frame.verdict import MoveVerdict, Reason
from cosmic.vico.core.image import CameraImage, Circumstances
from cosmic.vico.hw.interface import Frame, FrameStatus, PixelFormat

IMAGE_S = 1.0 / 15.0


class Moving(Operation[str]):
    """A movement on its way; the test ends it."""

    def __init__(self) -> None:
        super().__init__("move")

    def cancel(self) -> None:
        super().cancel()
        if not self.done:
            self.fail(MoveCancelled("cancelled"))


class Scene:
    """A clock, a camera, a movement and what is seen of its aim."""

    name = "microscope"

    def __init__(self, **limits: float) -> None:
        self.clock = ManualClock()
        self.down = Moving()
        self.aside: list[tuple[float, Moving]] = []
        self.seen: Aim | None = Aim(0.0, 1.0)
        self.at_rest: list[bool] = []
        self.listeners: list[Callable[[], object]] = []
        self._image: CameraImage | None = None
        bounds = {"close_um": 10.0, "most_um": 100.0} | limits
        self.move = GuidedMove(
            RetryingMove(lambda: self.down),
            camera=self,  # type: ignore[arg-type]
            clock=self.clock,
            look=self.look,
            correct=self.correct,
            target_um=0.0,
            limits=AimLimits(**bounds),
        )

    def look(self, _image: CameraImage, at_rest: bool) -> Aim | None:
        self.at_rest.append(at_rest)
        return self.seen

    def correct(self, to_um: float) -> RetryingMove:
        self.aside.append((to_um, Moving()))
        return RetryingMove(lambda: self.aside[-1][1])

    def image_since(self, since_s: float) -> CameraImage | None:
        image = self._image
        return image if image is not None and image.frame.exposed_s >= since_s else None

    def on_image(self, listener: Callable[[], object]) -> Callable[[], None]:
        self.listeners.append(listener)
        return lambda: self.listeners.remove(listener)

    def expose(self, seen: Any = ..., times: int = 1) -> bool:
        """Let so many images come, one after the other; returns whether it has ended then."""
        self.seen = self.seen if seen is ... else seen
        for _ in range(times):
            self.clock.advance(IMAGE_S)
            now_s, data = self.clock.now_s(), np.zeros((4, 4), np.uint8)
            frame = Frame(data, 1, now_s, now_s, None, FrameStatus.COMPLETE, PixelFormat.MONO8)
            self._image = CameraImage("microscope", frame, Circumstances())
            for each in self.listeners:
                each()
            ended = self.move.done
        return ended


def test_what_shifts_is_gone_along_with_and_the_next_correction_waits_for_the_one_before():
    scene = Scene()
    assert not scene.expose(Aim(3.0, 1.0)), "near enough"
    assert scene.aside == []
    scene.expose(Aim(30.0, 1.0))
    scene.expose(Aim(60.0, 1.0))
    assert [to_um for to_um, _ in scene.aside] == [30.0]
    scene.aside[0][1].finish("there")
    scene.expose(Aim(62.0, 1.0))
    assert [to_um for to_um, _ in scene.aside] == [30.0, 62.0]
    assert scene.move.corrections == 2


def test_it_ends_when_all_stand_and_an_image_exposed_since_shows_the_aim():
    scene = Scene()
    scene.expose(Aim(30.0, 1.0))
    scene.down.finish("down")
    assert not scene.expose()
    scene.aside[0][1].finish("there")
    assert not scene.move.done, "no image since"
    assert scene.expose(Aim(31.0, 1.0))
    assert scene.move.wait(0.0) is scene.move
    assert scene.listeners == []


def test_positions_are_not_trusted_while_a_correction_goes_on_nor_right_after():
    scene = Scene()
    scene.expose()
    scene.expose(Aim(30.0, 1.0))
    scene.expose()
    scene.aside[0][1].finish("there")
    scene.expose(times=int(LAG_S / IMAGE_S) + 1)
    assert scene.at_rest == [True, True, False, False, False, True]


def test_what_may_be_noise_is_not_followed():
    scene = Scene()
    scene.expose(Aim(30.0, 15.0), times=3)
    assert scene.aside == []


def test_an_aim_beyond_the_bound_ends_it_in_words_and_stops_what_moves():
    scene = Scene()
    scene.expose(Aim(90.0, 1.0))
    assert scene.expose(Aim(101.0, 1.0))
    assert scene.down.done and scene.aside[0][1].done
    with pytest.raises(OperationFailed, match=r"101 um .* 100 um are allowed") as failed:
        scene.move.wait(0.0)
    assert failed.value.cause == STRAYED


def test_what_was_seen_and_is_lost_ends_it_and_what_was_never_seen_does_not():
    scene = Scene()
    scene.expose()
    assert not scene.expose(None, times=LOST_AFTER - 1)
    assert scene.expose()
    with pytest.raises(OperationFailed) as failed:
        scene.move.wait(0.0)
    assert failed.value.cause == OUT_OF_SIGHT
    blind = Scene()
    assert not blind.expose(None, times=2 * LOST_AFTER)
    blind.down.finish("down")
    blind.move.wait(1.0)
    assert blind.aside == []


def test_without_any_image_it_is_the_movement_alone():
    scene = Scene()
    scene.down.finish("down")
    assert not scene.move.done
    with pytest.raises(DeviceTimeout):
        scene.move.wait(0.0)
    scene.clock.advance(REST_S + 0.1)
    assert scene.move.done


def test_ended_it_stays_ended_though_the_aim_goes_on():
    scene = Scene()
    scene.down.finish("down")
    assert not scene.move.done
    assert scene.expose()
    scene.seen = Aim(50.0, 1.0)
    scene.expose()
    assert scene.move.wait(0.0) is scene.move
    assert scene.aside == []


def test_a_stop_or_a_refused_correction_ends_all_of_it():
    scene = Scene()
    scene.expose(Aim(30.0, 1.0))
    stopped = StoppedError(MoveVerdict(allowed=False, reason=Reason.STOPPED, text="stopped"))
    scene.down.fail(stopped)
    assert scene.move.done
    assert scene.aside[0][1].done
    with pytest.raises(StoppedError):
        scene.move.wait(0.0)
    refused = Scene()
    refused.expose(Aim(30.0, 1.0))
    verdict = MoveVerdict(allowed=False, reason=Reason.COLLISION, text="in the way")
    refused.aside[0][1].fail(MoveRefused(verdict))
    assert refused.move.done and refused.down.done
    with pytest.raises(MoveRefused, match="in the way"):
        refused.move.wait(0.0)


def test_cancelled_it_ends_when_all_that_it_has_set_in_motion_has():
    scene = Scene()
    scene.move.add_callback(lambda _: None)
    scene.expose(Aim(30.0, 1.0))
    scene.move.cancel()
    assert scene.down.done and scene.aside[0][1].done
    assert scene.move.done and scene.listeners == []
    with pytest.raises(MoveCancelled):
        scene.move.wait(0.0)


def test_a_window_in_which_another_fibre_may_lie_is_refused():
    with pytest.raises(ValueError, match="follow_um lies above clear_um"):
        GraspSettings(follow_um=56.0)
    assert GraspSettings(follow_um=56.0, clear_um=60.0).follow_um == 56.0
    assert GraspSettings(clear_um=30.0).followed_um == 30.0, "recipes of before stay valid"
