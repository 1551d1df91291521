"""IIDC cameras through libdc1394, with a stand-in for that library, written in C."""

import ctypes
import shutil
import subprocess
import tempfile
from contextlib import ExitStack
from functools import cache
from pathlib import Path
from typing import Self

from typing_extensions import override

from contract.cameras import CameraRig, Can
from cosmic.vico.hw.dc1394 import Dc1394Library
from cosmic.vico.hw.interface import Roi

SCALABLE, FIXED = "0800460200000001", "0800460200000002"


@cache
def built() -> bytes:
    """Return the stand-in library, compiled once a run."""
    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder) / "libfake_dc1394.so"
        source = Path(__file__).with_name("fake_dc1394.c")
        flags = ["-shared", "-fPIC", "-O2", "-Wall", "-Wextra", "-Werror"]
        subprocess.run(["cc", *flags, "-o", made, source], check=True, timeout=60)
        return made.read_bytes()


class FakeDc1394:
    """A fresh copy of the stand-in; a context manager, which checks that nothing is left open."""

    library: ctypes.CDLL

    def __enter__(self) -> Self:
        self._ended = ExitStack()
        folder = self._ended.enter_context(tempfile.TemporaryDirectory())
        file = Path(folder) / "libfake_dc1394.so"
        file.write_bytes(built())
        self.library = ctypes.CDLL(str(file))  # a file of its own has variables of its own
        return self

    def __exit__(self, kind: object, *_rest: object) -> None:
        self._ended.close()
        assert kind or not self.library.fake_left_open(), "a camera or a list was not given back"


class ScalableRig(CameraRig):
    """A camera with format 7."""

    name = "dc1394"
    can = frozenset(Can) - {Can.BINNING}
    key = SCALABLE
    number = 0
    rate_hz = 60.0
    roi = Roi(64, 32, 320, 240)

    @override
    @classmethod
    def missing(cls) -> str:
        return "" if shutil.which("cc") else "no C compiler (cc) for the stand-in of libdc1394"

    @override
    def __enter__(self) -> Self:
        self.fake = FakeDc1394().__enter__()
        self.library = Dc1394Library(self.clock, shutter_unit_s=1e-5, library=self.fake.library)
        return self

    @override
    def __exit__(self, *exc: object) -> None:
        self.library.close()
        self.fake.__exit__(*exc)

    @override
    def unplug(self) -> None:
        self.fake.library.fake_plug(self.number, 0)

    @override
    def plug_in(self) -> None:
        self.fake.library.fake_plug(self.number, 1)


class FixedRig(ScalableRig):
    """An older camera: fixed modes, a shutter in counts, no gain and no trigger."""

    name = "dc1394-fixed"
    can = frozenset({Can.EXPOSURE, Can.RATE, Can.UNPLUG})
    key = FIXED
    number = 1
    rate_hz = 30.0
    roi = None


RIGS = (ScalableRig, FixedRig)
