"""Makes the acquisition boards that the configuration names."""

from collections.abc import Mapping, Sequence

from typing_extensions import override

from cosmic.daqco.hw.interface import Board, BoardContext, BoardInfo, BoardLibrary, Source
from cosmic.daqco.hw.joined_boards import JoinedLibrary
from cosmic.frame.clock import WALL, Clock
from cosmic.frame.errors import DeviceFault, NotConnectedError
from cosmic.frame.plugins import Kind, make
from cosmic.twin.trigger_line import TriggerLine


def make_library(
    backend: str,
    *,
    clock: Clock | None = None,
    scene_sources: Mapping[tuple[str, str], Source] | None = None,
    clock_sources: Mapping[str, str] | None = None,
    start_triggers: Mapping[str, str] | None = None,
    trigger_lines: Mapping[str, TriggerLine] | None = None,
    options: Mapping[str, object] | None = None,
    seed: int = 0,
) -> BoardLibrary:
    """Return the boards of `backend`; none is opened.

    Parameters
    ----------
    backend : str
        "simulated", "nidaqmx" for boards of National Instruments, "labjack" for those of LabJack,
        or what another package brings (`cosmic.frame.plugins`). None ever stands in for another,
        and only this one is loaded.
    clock : Clock or None
        The platform's, which paces simulated boards and stamps real ones; None is the wall's.
    scene_sources : mapping of (str, str) to Source, or None
        For "simulated": what the twin connects to each board and input.
    clock_sources : mapping of str to str, or None
        Terminals from which boards take their sample clock, by board, such as
        ``{"Dev2": "/Dev1/ai/SampleClock"}``.
    start_triggers : mapping of str to str, or None
        Terminals whose rising edge starts a board: ``{"Dev1": "/Dev1/PFI0"}``.
    trigger_lines : mapping of str to TriggerLine, or None
        For "simulated": what the twin connects to the counters of boards.
    options : mapping, or None
        The backend's own settings.

    Raises
    ------
    ConfigError
        There is no such backend, or its options are wrong.
    """
    context = BoardContext(
        clock or WALL,
        clock_sources or {},
        scene_sources,
        seed,
        start_triggers or {},
        trigger_lines or {},
    )
    library: BoardLibrary = make(Kind.BOARD, backend, context, options or {})
    return library


def join(libraries: Sequence[BoardLibrary]) -> BoardLibrary:
    """Return the boards of several makes as one library; one alone stays as it is."""
    return libraries[0] if len(libraries) == 1 else JoinedLibrary(libraries)


class UnavailableBoards(BoardLibrary):
    """In place of boards that cannot be made; there are none, and each call says why.

    Parameters
    ----------
    backend : str
        What the configuration names.
    reason : str
        What the operator reads.
    """

    def __init__(self, backend: str, reason: str) -> None:
        self._backend = backend
        self._reason = reason

    @property
    @override
    def name(self) -> str:
        return self._backend

    @override
    def list_boards(self) -> tuple[BoardInfo, ...]:
        raise NotConnectedError(self._reason, fault=DeviceFault.UNSUPPORTED)

    @override
    def open(self, name: str) -> Board:
        raise NotConnectedError(f"{name}: {self._reason}", fault=DeviceFault.UNSUPPORTED)
