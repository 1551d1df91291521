"""The boards of LabJack that the LJM library knows (extra `labjack`)."""

import io
import logging
from collections.abc import Iterable, Mapping
from contextlib import redirect_stdout
from dataclasses import dataclass
from importlib import import_module
from threading import RLock
from typing import Any, Final, Literal

from pydantic import Field
from typing_extensions import override

from cosmic.daqco.hw.interface import (
    BoardBackend,
    BoardContext,
    BoardInfo,
    BoardLibrary,
    InputMode,
)
from cosmic.daqco.hw.labjack_board import LabjackBoard
from cosmic.daqco.hw.labjack_connection import Connection
from cosmic.daqco.hw.labjack_errors import board_error
from cosmic.daqco.hw.labjack_outputs import LabjackOutputs
from cosmic.daqco.hw.outputs import BoardOutputs
from cosmic.frame.clock import WALL, Clock
from cosmic.frame.config import StrictModel
from cosmic.frame.errors import DeviceFault, NotAvailable, NotConnectedError, needs_extra

logger = logging.getLogger(__name__)

USB: Final = 1
"""LJM's number of a connection by USB."""


class LabjackOptions(StrictModel):
    """What the configuration may say under ``options``.

    Attributes
    ----------
    connection : str
        Where boards are looked for.
    resolution_index : int
        Of the stream; 0 is the board's own choice, a higher one less noise and lower rates.
    """

    connection: Literal["any", "usb", "ethernet", "wifi"] = "any"
    resolution_index: int = Field(default=0, ge=0, le=16)


@dataclass(frozen=True, slots=True)
class _Kind:
    """What a kind of board has (T-series data sheet, chapters 3.2, 14 and 15)."""

    name: str
    inputs: int
    rate_hz: float
    ranges_v: tuple[tuple[float, float], ...]
    modes: tuple[InputMode, ...]
    paired: bool


def _both(*ends_v: float) -> tuple[tuple[float, float], ...]:
    return tuple((-end, end) for end in ends_v)


_RSE, _DIFFERENTIAL = InputMode.RSE, InputMode.DIFFERENTIAL
_T8_ENDS_V: Final = (11.0, 9.6, 4.8, 2.4, 1.2, 0.6, 0.3, 0.15, 0.075, 0.036, 0.018)
KINDS: Final = {
    4: _Kind("T4", 12, 50e3, ((-10.0, 10.0), (0.0, 2.5)), (_RSE,), paired=False),
    7: _Kind("T7", 14, 100e3, _both(10.0, 1.0, 0.1, 0.01), (_RSE, _DIFFERENTIAL), paired=True),
    8: _Kind("T8", 8, 400e3, _both(*_T8_ENDS_V), (_DIFFERENTIAL,), paired=False),
}
"""By LJM's number of the device type."""


def load_ljm() -> Any:
    """Return the package ``labjack.ljm``.

    Raises
    ------
    NotAvailable
        The package is not installed.
    NotConnectedError
        It is, but not LabJack's library that it calls.
    """
    said = io.StringIO()
    try:
        with redirect_stdout(said):  # the package prints where its library is missing
            module = import_module("labjack.ljm")
    except ImportError as exc:
        raise NotAvailable(needs_extra("A board of LabJack", "labjack")) from exc
    if getattr(module.ljm, "_staticLib", None) is None:
        logger.debug("LJM: %s", said.getvalue().strip())
        raise NotConnectedError(
            "the driver of LabJack's boards, the LJM library, is not installed on this computer. "
            "Install LJM from labjack.com (Windows, macOS or Linux), start the computer again, and "
            "see that Kipling lists the board. The simulated boards need no driver: backend = "
            '"simulated" in platform.toml, [daqco]',
            fault=DeviceFault.COMMUNICATION,
        )
    return module


class LabjackLibrary(BoardLibrary):
    """T4, T7 and T8 by the LJM library; any thread.

    A board is called by its kind and its serial number, such as "T7_470010103".

    Parameters
    ----------
    clock : Clock
        Stamps the samples: the platform's.
    api : module or None
        ``labjack.ljm``, or what tests put in its place; None loads it when it is needed.
    """

    def __init__(
        self, clock: Clock = WALL, options: LabjackOptions | None = None, *, api: Any = None
    ) -> None:
        self._clock = clock
        self._options = options or LabjackOptions()
        self._api = api
        self._lock = RLock()
        self._connections: dict[str, Connection] = {}
        self._owners: dict[str, LabjackBoard] = {}

    @property
    @override
    def name(self) -> str:
        try:
            api = self._loaded()
            version = float(api.readLibraryConfigS("LJM_LIBRARY_VERSION"))
        except (NotAvailable, NotConnectedError):
            return "LabJack LJM (not installed)"
        except self._api.LJMError:
            return "LabJack LJM"
        return f"LabJack LJM {version:.4f}"

    @override
    def list_boards(self) -> tuple[BoardInfo, ...]:
        api = self._loaded()
        try:
            _, kinds, buses, serials, _ = api.listAllS("ANY", self._options.connection.upper())
        except api.LJMError as exc:
            raise board_error(exc, "list the boards", "LJM") from exc
        found: dict[int, BoardInfo] = {}
        # One that is connected twice is listed twice; LJM opens it by USB.
        for bus, kind, serial in sorted(
            zip(buses, kinds, serials, strict=True), key=lambda each: each[0] != USB
        ):
            if kind in KINDS:
                found.setdefault(serial, info_of(kind, serial))
            else:
                logger.info("LJM: the device %s of type %s (%s) is left out", serial, kind, bus)
        return tuple(found[serial] for serial in sorted(found))

    @override
    def open(self, name: str) -> LabjackBoard:
        found = {info.name: info for info in self.list_boards()}
        if name not in found:
            raise self._not_there(name, found)
        return LabjackBoard(
            self._api,
            found[name],
            self._connection(found[name]),
            self._clock,
            owners=self._owners,
            resolution_index=self._options.resolution_index,
        )

    def open_outputs(self, board: str) -> BoardOutputs:
        """Return the outputs of a board; raises `NotConnectedError` where there is none."""
        found = {info.name: info for info in self.list_boards()}
        if board not in found:
            raise self._not_there(board, found)
        return LabjackOutputs(self._api, found[board], self._connection(found[board]))

    def _not_there(self, board: str, found: Iterable[str]) -> NotConnectedError:
        return NotConnectedError(
            f"LJM knows no board {board!r}; it lists: {', '.join(found) or 'none'}. A board is "
            f"called by its kind and serial number, such as T7_470010103",
            fault=DeviceFault.COMMUNICATION,
        )

    def _connection(self, info: BoardInfo) -> Connection:
        with self._lock:
            bus = self._options.connection.upper()
            made = Connection(self._api, info.name, info.product, info.serial, bus)
            return self._connections.setdefault(info.name, made)

    def _loaded(self) -> Any:
        if self._api is None:
            self._api = load_ljm()
        return self._api


def info_of(kind: int, serial: int) -> BoardInfo:
    """Return what a board of LJM's device type `kind` is and can."""
    made = KINDS[kind]
    inputs = tuple(f"ai{number}" for number in range(made.inputs))
    pairs = tuple(zip(inputs[::2], inputs[1::2], strict=True)) if made.paired else ()
    return BoardInfo(
        name=f"{made.name}_{serial}",
        product=made.name,
        simulated=False,
        serial=serial,
        inputs=inputs,
        max_single_rate_hz=made.rate_hz,
        max_multi_rate_hz=made.rate_hz,
        ranges_v=made.ranges_v,
        modes=made.modes,
        pairs=pairs,
    )


def _make(options: LabjackOptions, context: BoardContext) -> BoardLibrary:
    _check_clocks(context.clock_sources)
    _check_triggers(context.start_triggers)
    return LabjackLibrary(context.clock, options)


def _check_clocks(sources: Mapping[str, str]) -> None:
    for board in filter(_is_ours, sources):
        raise NotAvailable(f"clock_sources: {board}: a LabJack board keeps to its own clock")


def _check_triggers(triggers: Mapping[str, str]) -> None:
    for board in filter(_is_ours, triggers):
        raise NotAvailable(f"start_triggers: {board}: a LabJack board starts on command only")


def _is_ours(board: str) -> bool:
    return board.startswith(tuple(f"{each.name}_" for each in KINDS.values()))


BACKEND: Final = BoardBackend(_make, options=LabjackOptions)
