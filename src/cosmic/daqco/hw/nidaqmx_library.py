"""The boards that NI-DAQmx knows."""

import logging
from collections.abc import Iterable, Mapping
from typing import Any, Final

import nidaqmx
import nidaqmx.stream_readers
import nidaqmx.stream_writers
import nidaqmx.system
from nidaqmx.errors import DaqNotFoundError, Error
from typing_extensions import override

from cosmic.daqco.hw.interface import BoardBackend, BoardContext, BoardInfo, BoardLibrary
from cosmic.daqco.hw.nidaqmx_board import NidaqmxBoard
from cosmic.daqco.hw.nidaqmx_errors import board_error
from cosmic.daqco.hw.nidaqmx_outputs import NidaqmxOutputs, outputs_info
from cosmic.daqco.hw.outputs import BoardOutputs
from cosmic.frame.clock import WALL, Clock
from cosmic.frame.errors import DeviceFault, NotConnectedError
from cosmic.frame.plugins import NoOptions

logger = logging.getLogger(__name__)


class NidaqmxLibrary(BoardLibrary):
    """The NI-DAQmx driver; any thread.

    Parameters
    ----------
    clock : Clock
        Stamps the samples: the platform's.
    clock_sources : mapping of str to str, or None
        Terminal of the sample clock by board; the others use their own.
    start_triggers : mapping of str to str, or None
        Terminal whose rising edge starts a board; the others start when they are told to.
    api : module
        nidaqmx, or what tests put in its place.
    """

    def __init__(
        self,
        clock: Clock = WALL,
        *,
        clock_sources: Mapping[str, str] | None = None,
        start_triggers: Mapping[str, str] | None = None,
        api: Any = nidaqmx,
    ) -> None:
        self._clock = clock
        self._clock_sources = dict(clock_sources or {})
        self._start_triggers = dict(start_triggers or {})
        self._api = api

    @property
    @override
    def name(self) -> str:
        try:
            version = self._api.system.System.local().driver_version
        except DaqNotFoundError:
            return "NI-DAQmx (not installed)"
        except Error:
            return "NI-DAQmx"
        return f"NI-DAQmx {version.major_version}.{version.minor_version}"

    @override
    def list_boards(self) -> tuple[BoardInfo, ...]:
        return tuple(info for info, _ in self._found())

    @override
    def open(self, name: str) -> NidaqmxBoard:
        found = {info.name: (info, device) for info, device in self._found()}
        if name not in found:
            raise self._not_there(name, found)
        info, device = found[name]
        try:
            wiring = {_short(each.name): each.ai_term_cfgs for each in device.ai_physical_chans}
        except Error as exc:
            raise board_error(exc, "open", name) from exc
        return NidaqmxBoard(
            self._api,
            info,
            wiring,
            self._clock,
            clock_source=self._clock_sources.get(name, ""),
            start_trigger=self._start_triggers.get(name, ""),
        )

    def open_outputs(self, board: str) -> BoardOutputs:
        """Return the outputs of a board; raises `NotConnectedError` where there is none."""
        found = {info.name: device for info, device in self._found()}
        if board not in found:
            raise self._not_there(board, found)
        try:
            info = outputs_info(found[board])
        except Error as exc:
            raise board_error(exc, "open its outputs", board) from exc
        return NidaqmxOutputs(self._api, info)

    def _not_there(self, board: str, found: Iterable[str]) -> NotConnectedError:
        return NotConnectedError(
            f"NI-DAQmx knows no board {board!r} with analogue inputs; it lists: "
            f"{', '.join(found) or 'none'}. Names are given in NI MAX",
            fault=DeviceFault.COMMUNICATION,
        )

    def _found(self) -> list[tuple[BoardInfo, Any]]:
        try:
            devices = list(self._api.system.System.local().devices)
        except Error as exc:
            raise board_error(exc, "list the boards", "NI-DAQmx") from exc
        found = []
        for device in devices:
            try:
                info = _info(device)
            except Error as exc:
                # A chassis, or a board that is listed but not plugged in.
                logger.info("NI-DAQmx: %s is left out: %s", device.name, exc)
                continue
            if info is not None:
                found.append((info, device))
        return found


def _info(device: Any) -> BoardInfo | None:
    """Return what a device is; None when it has no analogue inputs for voltages."""
    inputs = tuple(_short(each.name) for each in device.ai_physical_chans)
    if not inputs:
        return None
    flat = [float(end) for end in device.ai_voltage_rngs]
    if not flat:
        return None  # a module for currents, or thermocouples
    ranges = sorted(zip(flat[::2], flat[1::2], strict=True), key=lambda pair: pair[0] - pair[1])
    return BoardInfo(
        name=str(device.name),
        product=str(device.product_type),
        simulated=bool(device.is_simulated),
        serial=int(device.serial_num),
        inputs=inputs,
        max_single_rate_hz=float(device.ai_max_single_chan_rate),
        max_multi_rate_hz=float(device.ai_max_multi_chan_rate),
        ranges_v=tuple(ranges),
    )


def _short(physical: str) -> str:
    return physical.rpartition("/")[2]


def _make(_options: NoOptions, context: BoardContext) -> BoardLibrary:
    return NidaqmxLibrary(
        context.clock,
        clock_sources=context.clock_sources,
        start_triggers=context.start_triggers,
    )


BACKEND: Final = BoardBackend(_make)
