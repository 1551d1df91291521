"""Boards of several makes as one library."""

from collections.abc import Sequence

from typing_extensions import override

from cosmic.daqco.hw.interface import Board, BoardInfo, BoardLibrary
from cosmic.frame.errors import ConfigError, DeviceFault, NotConnectedError


class JoinedLibrary(BoardLibrary):
    """The boards of several drivers, one after the other; any thread.

    None of the drivers stands in for another: where one is missing, none of their boards is listed.

    Parameters
    ----------
    libraries : sequence of BoardLibrary
        In the order in which their boards are listed.
    """

    def __init__(self, libraries: Sequence[BoardLibrary]) -> None:
        self._libraries = tuple(libraries)

    @property
    @override
    def name(self) -> str:
        return ", ".join(each.name for each in self._libraries)

    @override
    def list_boards(self) -> tuple[BoardInfo, ...]:
        return tuple(info for info, _ in self._found().values())

    @override
    def open(self, name: str) -> Board:
        return self.library_of(name).open(name)

    def library_of(self, board: str) -> BoardLibrary:
        """Return the library that lists a board; raises `NotConnectedError` where none does."""
        found = self._found()
        if board not in found:
            raise NotConnectedError(
                f"there is no board {board!r}; {self.name} list: {', '.join(found) or 'none'}",
                fault=DeviceFault.COMMUNICATION,
            )
        return found[board][1]

    def _found(self) -> dict[str, tuple[BoardInfo, BoardLibrary]]:
        found: dict[str, tuple[BoardInfo, BoardLibrary]] = {}
        for library in self._libraries:
            for info in library.list_boards():
                if info.name in found:
                    raise ConfigError(
                        f"two boards are called {info.name}: one of {found[info.name][1].name}, "
                        f"one of {library.name}; give one of them another name"
                    )
                found[info.name] = info, library
        return found
