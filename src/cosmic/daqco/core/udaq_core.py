"""`UDaqCore`: acquires from all boards in a thread of its own (thesis 6.2.1, Fig. 6.12)."""

import logging
from collections.abc import Callable, Mapping, Sequence
from typing import Final

import numpy as np
from PySide6.QtCore import QObject, Signal
from typing_extensions import override

from cosmic.daqco.core.chunk import DataChunk
from cosmic.daqco.core.plan import AcquisitionPlan
from cosmic.daqco.core.scale import Scale
from cosmic.daqco.hw.board_group import BoardGroup, ClockAgreement
from cosmic.daqco.hw.interface import Board, BoardChunk
from cosmic.daqco.hw.pulses import PulsingBoard
from cosmic.frame.clock import WALL
from cosmic.frame.errors import DeviceError, DeviceFault, DeviceTimeout
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.threads import WorkerThread

logger = logging.getLogger(__name__)

LOOK_S: Final = 0.05
SILENT_S: Final = 10.0
"""A real board of which nothing has come for so long, and for some chunks more, has failed."""

SILENT_CHUNKS: Final = 3


class UDaqCore(WorkerThread):
    """Starts the boards of a plan and hands their chunks on until it is ended.

    One object is one acquisition; its boards are received from by one call (`BoardGroup`).

    Parameters
    ----------
    clocked : sequence of str
        Boards that take their sample clock from another; they are started first.
    clock_ppm : float
        How far off the clock of any real board may be, in parts of a million.

    Signals
    -------
    failed(DeviceError)
        A board failed or lost samples; the acquisition has ended.
    """

    may_wait = False

    failed = Signal(object)

    def __init__(
        self,
        plan: AcquisitionPlan,
        boards: Mapping[str, Board],
        scales: Mapping[str, Scale],
        put: Callable[[DataChunk], None],
        policy: FailurePolicy,
        *,
        clocked: Sequence[str] = (),
        clock_ppm: float = 0.0,
        parent: QObject | None = None,
    ) -> None:
        super().__init__("acquisition", policy, parent)
        self.plan = plan
        self._each = dict(boards)
        self._boards = BoardGroup(
            [boards[name] for name in plan.boards], clocked, clock_ppm=clock_ppm
        )
        self._put = put
        self._scales = tuple(scales[each.name] for each in plan.channels)
        self._names = tuple(each.name for each in plan.channels)
        in_order = plan.rows == tuple(range(len(plan.rows)))
        self._rows = None if in_order else np.array(plan.rows)
        self.rate_hz = plan.rate_hz
        self._given_up = False

    @property
    def asked(self) -> tuple[str, int] | None:
        """The board whose `receive` has not returned, and a number of that call."""
        return self._boards.asked

    @property
    def given_up(self) -> bool:
        """A board hangs; nothing more comes, and the thread ends when the board returns."""
        return self._given_up

    @property
    def agreement(self) -> tuple[ClockAgreement, ...]:
        """How well the sample clocks agree that are not one clock; known with the first chunk."""
        return self._boards.agreement

    def set_scales(self, scales: Mapping[str, Scale]) -> None:
        """Apply other scales from the next chunk on; any thread."""
        self._scales = tuple(scales[name] for name in self._names)

    def open(self) -> None:
        """Configure the boards and start them; raises what they raise, nothing runs then.

        Raises
        ------
        LimitError
            A board does not do what the plan asks.
        DeviceError
            A board is gone or taken.
        """
        plan = self.plan
        self._set_pulses()
        inputs = {board: plan.inputs(board) for board in plan.boards}
        self.rate_hz = self._boards.configure(inputs, plan.rate_hz, plan.chunk_samples)
        self._boards.start()
        self.start()

    def _set_pulses(self) -> None:
        train = self.plan.pulses
        for name in self.plan.boards:
            board = self._each[name]
            wanted = train if train is not None and train.board == name else None
            if isinstance(board, PulsingBoard):
                board.pulse(wanted)
            elif wanted is not None:
                raise DeviceError(
                    f"{name}: a {board.info.product} triggers no camera on its sample clock; "
                    f"leave camera_trigger out, or name another board",
                    fault=DeviceFault.UNSUPPORTED,
                )

    @override
    def run_body(self) -> None:
        chunk_s = self.plan.chunk_samples / self.rate_hz
        silence = _Silence(self._boards, SILENT_S + SILENT_CHUNKS * chunk_s)
        try:
            while not self.end_requested:
                chunk = self._boards.receive(LOOK_S)
                if self._given_up:
                    continue
                if chunk is None:
                    silence.look()
                    continue
                silence.broken()
                if not chunk.first_sample:
                    for each in self.agreement:
                        logger.warning("%s", each.text)
                self._put(self._scaled(chunk))
        except DeviceError as exc:
            if self._given_up:
                logger.warning("%s", exc)
            else:
                self.failed.emit(exc)
        finally:
            # Here alone: who asked for the end, a window perhaps, must not hang in a driver's stop.
            self._boards.stop()

    def _scaled(self, chunk: BoardChunk) -> DataChunk:
        volts = chunk.volts if self._rows is None else chunk.volts[self._rows]
        return DataChunk(
            first_sample=chunk.first_sample,
            time_s=chunk.time_s,
            rate_hz=self.rate_hz,
            channels=self._names,
            volts=volts,
            scales=self._scales,
        )

    def give_up(self) -> None:
        """Expect nothing more, for a board hangs; returns at once, whatever the board does."""
        self._given_up = True
        self._end_requested.set()


class _Silence:
    """For how long real boards have given nothing; a simulated one may wait as its clock does.

    Looks are counted as well: a computer that stood still is not taken for a board that is silent.
    """

    def __init__(self, boards: BoardGroup, most_s: float) -> None:
        self._boards, self._most_s = boards, most_s
        self.broken()

    def broken(self) -> None:
        """Begin anew, for a chunk came."""
        self._since_s, self._looks = WALL.now_s(), 0

    def look(self) -> None:
        """Raise `DeviceTimeout` where it has lasted too long."""
        self._looks += 1
        silent_s = min(self._looks * LOOK_S, WALL.now_s() - self._since_s)
        if silent_s <= self._most_s or not (names := self._boards.silent):
            return
        raise DeviceTimeout(
            f"{', '.join(names)}: no samples for {self._most_s:.3g} s, and no error. Acquisition "
            f"ended; check cable, sample clock and driver, then start again",
            fault=DeviceFault.TIMEOUT,
        )
