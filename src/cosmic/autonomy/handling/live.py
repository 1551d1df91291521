"""Pictures that are known to be new: a camera that freezes has its stream begun anew."""

import logging
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np

from cosmic.autonomy.handling.sight import PictureWanted
from cosmic.frame.clock import WALL, Clock
from cosmic.frame.errors import CosmicError, DeviceTimeout, NotAvailable
from cosmic.frame.task import Task
from cosmic.vico.api.camera import CameraHandle
from cosmic.vico.core.picture import Picture

logger = logging.getLogger(__name__)

RESTARTS: Final = 5
APART_WALL_S: Final = 1.0
POLL_WALL_S: Final = 0.002
APART_PX: Final = 16


@dataclass(slots=True, eq=False)
class LastSeen:
    """The last picture that was taken to be new."""

    picture: Picture | None = None

    def shows_the_same(self, picture: Picture) -> bool:
        """Return whether a later picture is the same to the last bit, which noise never allows."""
        before = self.picture
        if before is None or before.frame.exposed_s == picture.frame.exposed_s:
            return False
        some = picture.data[::APART_PX, ::APART_PX]
        # One without any light in it, or with too much, has no noise.
        return np.array_equal(before.data[::APART_PX, ::APART_PX], some) and bool(np.ptp(some))


class LivePicture:
    """A picture exposed from now on that is not an old one; to be yielded by an operation.

    Where the same picture comes again, or none, the camera is stopped and started, some times.

    Parameters
    ----------
    last : LastSeen
        Shared by all pictures of one camera.
    """

    def __init__(self, camera: CameraHandle, clock: Clock, last: LastSeen) -> None:
        self._camera = camera
        self._clock = clock
        self._last = last
        self._wanted = PictureWanted(camera, clock)
        self._steps: list[Callable[[], Task]] = []
        self._task: Task | None = None
        self._again_wall_s = 0.0
        self._restarts = 0
        self._picture: Picture | None = None
        self._error: CosmicError | None = None

    @property
    def done(self) -> bool:
        """A new one is there, or it was given up."""
        if self._picture is not None or self._error is not None:
            return True
        if self._task is not None or self._steps:
            self._restart()
            return False
        if self._wanted.done:
            self._take()
        return self._picture is not None or self._error is not None

    def _take(self) -> None:
        try:
            picture = self._wanted.wait(0.0)
        except NotAvailable as exc:
            self._begin_anew(exc)
            return
        if not self._last.shows_the_same(picture):
            self._last.picture = self._picture = picture
            return
        self._begin_anew(
            NotAvailable(
                f"{self._camera.name} shows the same picture again and again, also after its "
                f"stream was begun anew {self._restarts} times: look at the camera and its cable"
            )
        )

    def _begin_anew(self, trouble: CosmicError) -> None:
        if self._restarts >= RESTARTS:
            self._error = trouble
            return
        self._restarts += 1
        logger.warning("%s: no new picture; its stream is begun anew", self._camera.name)
        self._steps = [self._camera.stop, self._camera.start]
        self._again_wall_s = WALL.now_s() + APART_WALL_S * (self._restarts - 1)

    def _restart(self) -> None:
        """Go on with stopping and starting, without waiting for either."""
        if self._task is not None and not self._task.done:
            return
        if self._task is not None and self._task.failure is not None:
            logger.warning("%s: %s", self._camera.name, self._task.failure)
        self._task = None
        if not self._steps:
            self._wanted = PictureWanted(self._camera, self._clock)
        elif WALL.now_s() >= self._again_wall_s:
            self._task = self._steps.pop(0)()

    def add_callback(self, callback: Callable[["LivePicture"], object]) -> None:
        """Call `callback(self)` when the first picture may be there, in the camera's thread."""
        self._wanted.add_callback(lambda _: callback(self))

    def wait(self, timeout_s: float | None = None) -> Picture:
        """Wait for it, and return it.

        Raises
        ------
        NotAvailable
            None came that is new; the text says why.
        DeviceTimeout
            It had not come after `timeout_s` of wall time.
        """
        until_wall_s = WALL.now_s() + (1e9 if timeout_s is None else timeout_s)
        while not self.done:
            left_s = until_wall_s - WALL.now_s()
            if left_s <= 0.0:
                raise DeviceTimeout(f"no new picture of {self._camera.name} yet")
            WALL.sleep(min(left_s, POLL_WALL_S))
        if self._picture is None:
            assert self._error is not None
            raise self._error
        return self._picture

    def cancel(self) -> None:
        """Want it no longer; a camera that was stopped is started all the same."""
        self._wanted.cancel()
        if self._camera.start in self._steps:
            self._camera.start()
        self._steps, self._restarts = [], RESTARTS
        self._error = self._error or NotAvailable("the picture is no longer wanted")
