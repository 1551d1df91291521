"""A movement whose aim is corrected while it goes on, by what each image shows."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

from cosmic.autonomy.handling.retrying_move import RetryingMove
from cosmic.autonomy.procedures.operation import OperationFailed
from cosmic.frame.clock import WALL, Clock
from cosmic.frame.errors import CosmicError, DeviceTimeout
from cosmic.vico.api.camera import CameraHandle
from cosmic.vico.core.image import CameraImage

STRAYED: Final = "strayed"
OUT_OF_SIGHT: Final = "out of sight"
LOST_AFTER: Final = 3
"""Images in a row without what is aimed at, after one that showed it."""
TIMES_STD: Final = 3.0
"""What is less than so many standard deviations is noise."""
REST_S: Final = 1.0
"""How long an image is waited for that shows where a movement has led."""
LAG_S: Final = 0.15
"""How far what is known of positions may be behind an image."""
NEXT_S: Final = 1e-6
POLL_WALL_S: Final = 0.002


@dataclass(frozen=True, slots=True)
class Aim:
    """Where a movement should lead, as an image shows it.

    Attributes
    ----------
    target_um, std_um : float
        Along the direction that is corrected, on the platform, and how sure that is.
    """

    target_um: float
    std_um: float


@dataclass(frozen=True, slots=True)
class AimLimits:
    """How an aim is corrected.

    Attributes
    ----------
    close_um : float
        How far beside it is near enough.
    most_um : float
        How far from where the movement was to lead at first it may be.
    """

    close_um: float
    most_um: float


class GuidedMove:
    """A movement, and others that correct where it leads; to be yielded.

    Each image that comes is looked at in the thread of the run. A correction is a movement like any
    other, decided by the gate; the next is ordered when it has ended. Where nothing is seen from
    the beginning, or no image comes, it is the movement alone. It has ended when all stand and an
    image exposed since then shows that it is near enough.

    Parameters
    ----------
    look : callable
        Says of an image where to aim, None where it does not show it. Told besides whether the
        axes that correct have been at rest: what is known of their positions lags behind.
    correct : callable
        Begins a movement to a target, um.
    target_um : float
        Where it leads uncorrected.

    Attributes
    ----------
    corrections : int
        How many were made.

    Raises
    ------
    OperationFailed
        From `wait`: what is aimed at was seen and is no more, or is farther away than allowed.
    """

    def __init__(
        self,
        movement: RetryingMove,
        *,
        camera: CameraHandle,
        clock: Clock,
        look: Callable[[CameraImage, bool], Aim | None],
        correct: Callable[[float], RetryingMove],
        target_um: float,
        limits: AimLimits,
    ) -> None:
        self.corrections = 0
        self._movement = movement
        self._correction: RetryingMove | None = None
        self._camera = camera
        self._clock = clock
        self._look = look
        self._correct = correct
        self._first_um = self._target_um = target_um
        self._limits = limits
        self._last_s = clock.now_s()
        self._moved_s = -math.inf
        self._rest_s: float | None = None
        self._seen, self._fits, self._unseen = False, False, 0
        self._failure: CosmicError | None = None
        self._cancelled = self._ended = False
        self._leave: list[Callable[[], None]] = []

    def add_callback(self, callback: Callable[["GuidedMove"], object]) -> None:
        """Call `callback(self)` at each image and at the end, in the thread of either."""
        self._movement.add_callback(lambda _movement: callback(self))
        self._leave.append(self._camera.on_image(lambda: callback(self)))

    @property
    def done(self) -> bool:
        """It has ended, well or not."""
        if not self._ended:
            if not self._over:
                self._follow()
            self._ended = self._stands() and (self._over or self._arrived())
        return self._ended

    def _stands(self) -> bool:
        moves = (self._movement, self._correction)
        if all(each is None or each.done for each in moves):
            return True
        self._rest_s = None
        return False

    def _arrived(self) -> bool:
        now_s = self._clock.now_s()
        if self._rest_s is None:
            self._rest_s, self._fits = now_s, False
        never_seen = self._unseen >= LOST_AFTER and not self._seen
        return self._fits or never_seen or now_s > self._rest_s + REST_S

    @property
    def _over(self) -> bool:
        return self._cancelled or self._failure is not None

    def _follow(self) -> None:
        try:
            for each in (self._movement, self._correction):
                if each is not None and each.done:
                    each.wait(0.0)
            image = self._camera.image_since(self._last_s + NEXT_S)
            if image is not None:
                self._last_s = image.frame.exposed_s
                self._take(image)
        except CosmicError as exc:
            self._failure = exc
            self._end()

    def _take(self, image: CameraImage) -> None:
        idle = self._correction is None or self._correction.done
        if not idle:
            self._moved_s = self._clock.now_s()
        aim = self._look(image, image.frame.exposed_s > self._moved_s + LAG_S)
        if aim is None:
            self._unseen += 1
            if self._seen and self._unseen >= LOST_AFTER:
                raise OperationFailed(
                    OUT_OF_SIGHT,
                    "what the movement aims at was seen and is no more: check light and focus",
                )
            self._fits = False
            return
        self._seen, self._unseen = True, 0
        away = aim.target_um - self._first_um
        if not abs(away) <= self._limits.most_um:
            raise OperationFailed(
                STRAYED,
                f"the aim is {away:.0f} um from where it was when the movement began, and "
                f"{self._limits.most_um:g} um are allowed: look what moves there",
            )
        off = aim.target_um - self._target_um
        rests = self._rest_s is not None and image.frame.exposed_s >= self._rest_s
        self._fits = rests and abs(off) <= max(self._limits.close_um, TIMES_STD * aim.std_um)
        if idle and abs(off) > max(0.5 * self._limits.close_um, TIMES_STD * aim.std_um):
            self._target_um = aim.target_um
            self._correction = self._correct(aim.target_um)
            self._moved_s = self._clock.now_s()
            self.corrections += 1

    def wait(self, timeout_s: float | None = None) -> "GuidedMove":
        """Wait for the end, and return itself; raises what ended it otherwise."""
        until_wall_s = WALL.now_s() + (math.inf if timeout_s is None else timeout_s)
        while not self.done:
            left_s = until_wall_s - WALL.now_s()
            if left_s <= 0.0:
                raise DeviceTimeout("the movement has not ended yet")
            WALL.sleep(min(left_s, POLL_WALL_S))
        self._forget()
        if self._failure is not None:
            raise self._failure
        self._movement.wait(0.0)
        return self

    def _forget(self) -> None:
        while self._leave:
            self._leave.pop()()

    def _end(self) -> None:
        for each in (self._movement, self._correction):
            if each is not None:
                each.cancel()

    def cancel(self) -> None:
        """End it; what it has set in motion stops."""
        self._cancelled = True
        self._forget()
        self._end()
