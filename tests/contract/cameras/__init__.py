"""The cameras under contract: what each backend's module offers to tests/contract/test_camera.py.

A module of this package is named after its backend (simulated, aravis, opencv, harvesters,
dc1394) and offers `RIGS`, a tuple of subclasses of `CameraRig`, each one way to have a camera of
that backend: a view of the twin, a camera on loopback, a file. The tests are the same for all.

A rig is made once for all its tests (starting a camera takes its time), and each test opens the
camera anew; a test that unplugs the camera plugs it in again.
"""

from abc import ABC
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from enum import StrEnum
from typing import ClassVar, Self

from cosmic.frame.clock import Clock, RatedClock
from cosmic.vico.hw.interface import Camera, CameraLibrary, CameraSettings, Roi, Trigger


class Can(StrEnum):
    """What a rig's camera can; what is not named, its wrapper must say that it has not."""

    EXPOSURE = "exposure"
    GAIN = "gain"
    RATE = "rate"
    ROI = "a part of the sensor"
    BINNING = "binning"
    SOFTWARE_TRIGGER = "software trigger"
    UNPLUG = "be unplugged (the rig overrides unplug and plug_in)"


class CameraRig(ABC):
    """One way to have a camera; a context manager, which starts what it needs and ends it.

    Override `__enter__` (set `library`, return self) and `__exit__` (close `library`).

    Attributes
    ----------
    name : str
        Shown by pytest, such as "aravis-gv".
    can : frozenset of Can
        What the camera can.
    key : str
        Of the camera that the tests open.
    two : bool
        Whether there is a second camera that runs at the same time.
    other_key : str
        Of the second camera; "" where there is none.
    clock : Clock
        Given to the library. It runs with the wall but counts from elsewhere, so that a time
        that was not taken from it shows.
    library : CameraLibrary
    rate_hz : float
        At which the tests run it, where it can; else the rate it has.
    roi : Roi or None
        What the tests read of the sensor where it can, small to be quick; None is all of it.
    quiet_rate_hz : float
        A rate that it accepts so low that no frame comes for half a second; for rigs without
        a software trigger that can change their rate. 0: none.
    timeout_s : float
        How long the first frame may take.
    """

    name: ClassVar[str]
    can: ClassVar[frozenset[Can]] = frozenset()
    two: ClassVar[bool] = False
    key: str
    other_key: str = ""
    library: CameraLibrary
    rate_hz: float = 30.0
    roi: Roi | None = None
    quiet_rate_hz: float = 0.0
    timeout_s: float = 5.0

    def __init__(self) -> None:
        self.clock: Clock = RatedClock()

    @classmethod
    def missing(cls) -> str:
        """Return what this computer lacks for it, such as a program or a package; "" if nothing."""
        return ""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_exc: object) -> None:
        self.library.close()

    def unplug(self) -> None:
        """Take the camera away while it may be running."""
        raise NotImplementedError

    def plug_in(self) -> None:
        """Bring it back; it may take `timeout_s` until it can be opened."""
        raise NotImplementedError

    # --- what the tests use ---------------------------------------------------------------------

    @contextmanager
    def opened(self, key: str = "") -> Iterator[Camera]:
        """Open the camera, set for the tests, and close it afterwards."""
        camera = self.library.open(key or self.key)
        try:
            camera.configure(self.plain(camera))
            yield camera
        finally:
            camera.close()

    def plain(self, camera: Camera) -> CameraSettings:
        """Return the settings with which the tests run it."""
        settings = replace(camera.settings, trigger=Trigger.FREE_RUN)
        if Can.ROI in self.can and self.roi is not None:
            settings = replace(settings, roi=self.roi)
        if Can.EXPOSURE in self.can:
            settings = replace(settings, exposure_s=0.2 / self.rate_hz)
        if Can.RATE in self.can:
            settings = replace(settings, rate_hz=self.rate_hz)
        return settings

    def quiet(self, settings: CameraSettings) -> CameraSettings | None:
        """Return settings with which no frame comes for a while; None where it cannot."""
        if Can.SOFTWARE_TRIGGER in self.can:
            return replace(settings, trigger=Trigger.SOFTWARE)
        if Can.RATE in self.can and self.quiet_rate_hz:
            return replace(settings, rate_hz=self.quiet_rate_hz)
        return None
