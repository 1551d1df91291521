"""Makes the acquisition boards that the configuration names."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Literal

from cosmic.daqco.hw.interface import BoardLibrary
from cosmic.frame.clock import WALL, Clock

if TYPE_CHECKING:
    from cosmic.daqco.hw.sim_signal import Source

Backend = Literal["simulated", "nidaqmx"]


def make_library(
    backend: Backend,
    *,
    clock: Clock | None = None,
    scene_sources: Mapping[tuple[str, str], "Source"] | None = None,
    clock_sources: Mapping[str, str] | None = None,
    seed: int = 0,
) -> BoardLibrary:
    """Return the boards of `backend`; none is opened.

    Parameters
    ----------
    backend : str
        "simulated", or "nidaqmx" for boards of National Instruments. Neither ever stands in for
        the other.
    clock : Clock or None
        The platform's, which paces simulated boards and stamps real ones; None is the wall's.
    scene_sources : mapping of (str, str) to Source, or None
        For "simulated": what the twin connects to each board and input.
    clock_sources : mapping of str to str, or None
        For "nidaqmx": terminals from which boards take their sample clock, by board, such as
        ``{"Dev2": "/Dev1/ai/SampleClock"}``.
    """
    # Imported here, so that each platform loads its own backend only.
    if backend == "nidaqmx":
        from cosmic.daqco.hw.nidaqmx_library import NidaqmxLibrary

        return NidaqmxLibrary(clock or WALL, clock_sources=clock_sources)
    from cosmic.daqco.hw.sim_library import SimulatedLibrary

    return SimulatedLibrary(clock or WALL, scene_sources, seed=seed)
