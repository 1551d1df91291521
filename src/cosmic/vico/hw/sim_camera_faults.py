"""Faults of the simulated cameras, injected by name and decided by the seed."""

import random
from dataclasses import dataclass
from threading import Condition
from typing import Final

from cosmic.frame.arguments import check_fault
from cosmic.frame.errors import ArgumentError

NAMES: Final = ("unplugged", "taken", "incomplete", "lost", "frozen", "slow")


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault in force.

    Attributes
    ----------
    camera : str or None
        None: at all of them.
    share : float
        The part of the frames that it strikes.
    """

    name: str
    camera: str | None
    share: float


class CameraFaults:
    """Faults in force; any thread.

    Notes
    -----
    - `unplugged`: the camera is gone; what runs ends with an error, and it is neither listed nor
      opened until it is plugged in again. One that was open then must be opened anew.
    - `taken`: another program has the camera; it can be listed, not opened.
    - `incomplete`: frames arrive with parts missing.
    - `lost`: frames do not arrive.
    - `frozen`: frames arrive in time with the same image again and again.
    - `slow`: frames arrive half a second late.
    """

    def __init__(self, seed: int = 0) -> None:
        self.changed = Condition()
        """Notified when a fault comes or goes, and when a camera is stopped."""
        self._seed = seed
        self._active: tuple[Fault, ...] = ()
        self._pulled: dict[str | None, int] = {}

    @property
    def active(self) -> tuple[Fault, ...]:
        """Faults in force."""
        return self._active

    def inject(self, name: str, *, camera: str | None = None, share: float = 1.0) -> None:
        """Put a fault in force at one camera, or at all; raises `ArgumentError`.

        Parameters
        ----------
        share : float
            The part of the frames that it strikes, 0 to 1; which ones, the seed decides.
        """
        check_fault(name, NAMES)
        if not 0.0 <= share <= 1.0:
            raise ArgumentError(f"a part of the frames lies between 0 and 1, got {share!r}")
        with self.changed:
            self._active = (*self._active, Fault(name, camera, share))
            if name == "unplugged":
                self._pulled[camera] = self._pulled.get(camera, 0) + 1
            self.changed.notify_all()

    def clear(self, name: str | None = None, *, camera: str | None = None) -> None:
        """End the fault `name`, or all; with a camera only what was injected there."""
        if name is not None:
            check_fault(name, NAMES)
        with self.changed:
            self._active = tuple(
                each
                for each in self._active
                if not (name in (None, each.name) and camera in (None, each.camera))
            )
            self.changed.notify_all()

    def hit(self, name: str, camera: str) -> bool:
        """Whether a fault is in force at a camera."""
        return any(each.name == name and each.camera in (None, camera) for each in self._active)

    def strikes(self, name: str, camera: str, frame_id: int) -> bool:
        """Whether a fault strikes one frame of a camera."""
        return any(
            random.Random(f"{name} {camera} {frame_id} {self._seed}").random() < each.share
            for each in self._active
            if each.name == name and each.camera in (None, camera)
        )

    def times_pulled(self, camera: str) -> int:
        """Return how often a camera was unplugged."""
        return self._pulled.get(camera, 0) + self._pulled.get(None, 0)
