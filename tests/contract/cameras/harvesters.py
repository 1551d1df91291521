"""GenTL cameras: those of the virtual producer that comes with the genicam package."""

import importlib.util
from pathlib import Path
from typing import Self

from typing_extensions import override

from contract.cameras import CameraRig, Can
from cosmic.vico.hw.harvesters import HarvestersLibrary
from cosmic.vico.hw.interface import Roi


def virtual_producer() -> Path | None:
    """Return the virtual producer; None where it is not installed."""
    found = importlib.util.find_spec("genicam")
    places = found.submodule_search_locations if found else None
    files = [Path(each) / "viky.cti" for each in places or ()]
    return next((each for each in files if each.is_file()), None)


class HarvestersRig(CameraRig):
    name = "harvesters-viky"
    two = True
    can = frozenset({Can.RATE, Can.ROI})
    key = "VikyTL_DEV_red"
    other_key = "VikyTL_DEV_green"
    rate_hz = 100.0
    roi = Roi(0, 0, 160, 120)
    quiet_rate_hz = 1.0

    @classmethod
    @override
    def missing(cls) -> str:
        if importlib.util.find_spec("harvesters") is None or virtual_producer() is None:
            return "harvesters and genicam's virtual producer are not installed (extra gentl)"
        return ""

    @override
    def __enter__(self) -> Self:
        producer = virtual_producer()
        assert producer is not None
        self.library = HarvestersLibrary(self.clock, producers=[producer])
        return self


RIGS = (HarvestersRig,)
