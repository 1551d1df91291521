"""`UDaqCore`: acquires from all boards in a thread of its own (thesis 6.2.1, Fig. 6.12)."""

from collections.abc import Callable, Mapping, Sequence
from typing import Final

import numpy as np
from PySide6.QtCore import QObject, Signal
from typing_extensions import override

from cosmic.daqco.core.chunk import DataChunk
from cosmic.daqco.core.plan import AcquisitionPlan
from cosmic.daqco.core.scale import Scale
from cosmic.daqco.hw.interface import Board, BoardChunk, OverrunError
from cosmic.frame.errors import DeviceError
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.threads import WorkerThread

LOOK_S: Final = 0.05


class UDaqCore(WorkerThread):
    """Starts the boards of a plan, joins their chunks and hands them on until it is ended.

    One object is one acquisition. The chunks of several boards are joined by number; boards that
    are to stay in step over hours need a common sample clock.

    Parameters
    ----------
    clocked : sequence of str
        Boards that take their sample clock from another; they are started first.

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
        parent: QObject | None = None,
    ) -> None:
        super().__init__("acquisition", policy, parent)
        self.plan = plan
        self._boards = [boards[name] for name in plan.boards]
        self._put = put
        self._clocked = tuple(clocked)
        self._scales = tuple(scales[each.name] for each in plan.channels)
        self._names = tuple(each.name for each in plan.channels)
        in_order = plan.rows == tuple(range(len(plan.rows)))
        self._rows = None if in_order else np.array(plan.rows)
        self.rate_hz = plan.rate_hz

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
        rates = set()
        for board in self._boards:
            inputs = self.plan.inputs(board.info.name)
            rates.add(board.configure(inputs, self.plan.rate_hz, self.plan.chunk_samples))
        if len(rates) > 1:
            given = ", ".join(f"{rate:g} Hz" for rate in sorted(rates))
            raise DeviceError(f"the boards make different rates of this one: {given}")
        self.rate_hz = rates.pop()
        try:
            # Who waits for another's sample clock must listen before that clock begins.
            waiting = [each for each in self._boards if each.info.name in self._clocked]
            for board in (*waiting, *(each for each in self._boards if each not in waiting)):
                board.start()
        except DeviceError:
            self._stop_boards()
            raise
        self.start()

    @override
    def run_body(self) -> None:
        try:
            while not self.end_requested:
                pieces = self._pieces()
                if pieces is not None:
                    self._put(self._joined(pieces))
        except DeviceError as exc:
            self.failed.emit(exc)
        finally:
            self._stop_boards()

    def _pieces(self) -> list[BoardChunk] | None:
        """Return the next chunk of every board, or None when the end came first."""
        pieces: list[BoardChunk] = []
        for board in self._boards:
            piece = None
            while piece is None:
                if self.end_requested:
                    return None
                piece = board.receive(LOOK_S)
            pieces.append(piece)
        return pieces

    def _joined(self, pieces: list[BoardChunk]) -> DataChunk:
        first = pieces[0]
        for piece in pieces[1:]:
            if piece.first_sample != first.first_sample:
                raise OverrunError(
                    f"the boards are not in step: sample {first.first_sample} and "
                    f"{piece.first_sample} arrived together"
                )
        volts = first.volts
        if len(pieces) > 1:
            volts = np.concatenate([piece.volts for piece in pieces])
            volts = volts if self._rows is None else volts[self._rows]
        return DataChunk(
            first_sample=first.first_sample,
            time_s=first.time_s,
            rate_hz=self.rate_hz,
            channels=self._names,
            volts=volts,
            scales=self._scales,
        )

    def _stop_boards(self) -> None:
        for board in self._boards:
            board.stop()

    @override
    def request_end(self) -> None:
        super().request_end()
        self._stop_boards()
