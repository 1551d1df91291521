"""`BoardGroup`: the boards of one acquisition, received from by one call."""

import logging
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from cosmic.daqco.hw.interface import Board, BoardChunk, InputSettings, OverrunError, Volts
from cosmic.frame.clock import WALL
from cosmic.frame.errors import CosmicError, DeviceError, DeviceFault, only_cosmic_errors

logger = logging.getLogger(__name__)


@dataclass(frozen=True, slots=True)
class ClockAgreement:
    """How well the sample clock of a board agrees with that of the first board of a group.

    Attributes
    ----------
    offset_s : float
        By how much its sample 0 was taken later, as far as the two drivers can tell.
    drift_ppm : float
        How far the two may part, in parts of a million of the time that has passed.
    """

    board: str
    first: str
    offset_s: float
    drift_ppm: float

    def parted_s(self, after_s: float) -> float:
        """Return how far apart samples of one number may lie so long after the start, s."""
        return abs(self.offset_s) + 1e-6 * self.drift_ppm * after_s

    @property
    def text(self) -> str:
        """The same for the operator."""
        offset_ms, hour_ms = 1e3 * self.offset_s, 3600.0 * 1e-3 * self.drift_ppm
        return (
            f"{self.board} has a sample clock of its own: its samples lie {offset_ms:.1f} ms after "
            f"those of {self.first} at the start, and may part from them by {self.drift_ppm:g} ppm,"
            f" {hour_ms:.0f} ms an hour, until acquisition starts again"
        )


class BoardGroup:
    """Boards that acquire together; of any maker, real or simulated.

    Order of calls as of `Board`: `configure`, `start`, `receive` again and again, `stop`. One
    thread receives; any thread may stop. The boards stay with whoever opened them. Chunks are
    joined by the numbers of their samples; boards that are to stay in step over hours need a
    common sample clock, and `agreement` says how far the others may part.

    Parameters
    ----------
    boards : sequence of Board
        Their inputs follow each other in this order in every chunk.
    clocked : sequence of str
        Boards that take their sample clock from another; they are started first.
    clock_ppm : float
        How far off the clock of any real board may be, in parts of a million.
    """

    def __init__(
        self, boards: Sequence[Board], clocked: Sequence[str] = (), *, clock_ppm: float = 0.0
    ) -> None:
        if not boards:
            raise ValueError("a group has at least one board")
        self._boards = tuple(boards)
        self._clocked = frozenset(clocked)
        self._pieces: dict[int, BoardChunk] = {}
        self._shapes: list[tuple[int, int]] = []
        self._rate_hz = 0.0
        self._drift_ppm = 2.0 * clock_ppm
        self._agreement: tuple[ClockAgreement, ...] = ()
        self._calls = 0
        self._asked: tuple[str, int] | None = None

    @property
    def asked(self) -> tuple[str, int] | None:
        """The board whose `receive` has not returned, and a number of that call; any thread."""
        return self._asked

    @property
    def silent(self) -> tuple[str, ...]:
        """The real boards from which nothing has come that is not handed on yet."""
        return tuple(
            board.info.name
            for number, board in enumerate(self._boards)
            if number not in self._pieces and not board.info.simulated
        )

    @property
    def agreement(self) -> tuple[ClockAgreement, ...]:
        """How well the clocks agree that are not one clock; known with the first chunk."""
        return self._agreement

    def configure(
        self, inputs: Mapping[str, Sequence[InputSettings]], rate_hz: float, chunk_samples: int
    ) -> float:
        """Prepare all boards and return the rate that they really make, Hz.

        Parameters
        ----------
        inputs : mapping of str to sequence of InputSettings
            By board.

        Raises
        ------
        LimitError
            A board does not do what is asked.
        DeviceError
            A board is gone or taken, or they make different rates of this one.
        """
        rates: list[float] = []
        for board in self._boards:
            with only_cosmic_errors(board.info.name):
                rates.append(board.configure(inputs[board.info.name], rate_hz, chunk_samples))
        self._shapes = [(len(inputs[board.info.name]), chunk_samples) for board in self._boards]
        if max(rates) - min(rates) > 1e-6 * self._drift_ppm * min(rates):
            given = ", ".join(f"{rate:g} Hz" for rate in sorted(set(rates)))
            raise DeviceError(
                f"the boards make different rates of this one: {given}; choose one that all make, "
                f"such as 1000 Hz",
                fault=DeviceFault.PARAMETER,
            )
        self._rate_hz = rates[0]
        return rates[0]

    def start(self) -> None:
        """Begin to acquire on all boards; raises `DeviceError`, and none acquires then."""
        self._pieces, self._agreement = {}, ()
        # Who waits for another's sample clock must listen before that clock begins.
        in_order = sorted(self._boards, key=lambda board: board.info.name not in self._clocked)
        try:
            for board in in_order:
                with only_cosmic_errors(board.info.name):
                    board.start()
        except CosmicError as exc:
            self.stop()
            if isinstance(exc, DeviceError):
                raise
            raise DeviceError(str(exc)) from exc  # of a board that somebody brought

    def receive(self, timeout_s: float) -> BoardChunk | None:
        """Return the next chunk of all boards, or None after `timeout_s` of wall time.

        What some boards have brought by then is kept for the next call. Number and time are those
        of the first board, the rows those of all boards in their order.

        Raises
        ------
        DeviceError
            `OverrunError` when a board lost samples, or the boards are not in step; a board is
            gone, or failed. All have stopped, and nothing more comes before the next `start`.
        """
        until_s = WALL.now_s() + timeout_s
        try:
            for number in range(len(self._boards)):
                # All are looked at: one that failed may be what another waits for.
                if number not in self._pieces:
                    piece = self._piece(number, until_s - WALL.now_s())
                    if piece is not None:
                        self._pieces[number] = piece
            if len(self._pieces) < len(self._boards):
                return None
            return self._joined(self._whole_pieces())
        except CosmicError as exc:
            self.stop()
            if isinstance(exc, DeviceError):
                raise
            raise DeviceError(str(exc)) from exc  # of a board that somebody brought

    def _piece(self, number: int, wait_s: float) -> BoardChunk | None:
        """Return the next chunk of one board; raises `DeviceError`, also where it is none."""
        board = self._boards[number]
        with only_cosmic_errors(board.info.name):
            self._calls += 1
            self._asked = board.info.name, self._calls
            try:
                piece = board.receive(max(0.0, wait_s))
            finally:
                self._asked = None
            if piece is not None and not self._fits(piece.volts, number):
                raise ValueError(
                    f"a chunk of shape {piece.volts.shape} came instead of {self._shapes[number]}"
                )
            return piece

    def _whole_pieces(self) -> list[BoardChunk]:
        """Return as much of all boards as there is of each, and keep the rest for the next call."""
        pieces = [self._pieces[number] for number in range(len(self._boards))]
        count = min(each.volts.shape[1] for each in pieces)
        self._pieces = {
            number: self._part(each, slice(count, None))
            for number, each in enumerate(pieces)
            if each.volts.shape[1] > count
        }
        return [self._part(each, slice(count)) for each in pieces] if self._pieces else pieces

    def _part(self, piece: BoardChunk, samples: slice) -> BoardChunk:
        begin = samples.start or 0
        time_s = piece.time_s + begin / self._rate_hz
        return BoardChunk(piece.first_sample + begin, time_s, piece.volts[:, samples])

    def _fits(self, volts: Volts, number: int) -> bool:
        """Tell whether a chunk is what was asked for; of a simulated board it may be shorter."""
        rows, most = self._shapes[number]
        if self._boards[number].info.simulated:
            return volts.ndim == 2 and volts.shape[0] == rows and 1 <= volts.shape[1] <= most
        return volts.shape == (rows, most)

    def stop(self) -> None:
        """End acquiring; harmless when nothing runs. A `receive` that waits returns None."""
        for board in self._boards:
            try:
                board.stop()
            except Exception:  # of somebody else's board: the others are stopped too
                logger.exception("%s: stop failed", board.info.name)

    def _joined(self, pieces: list[BoardChunk]) -> BoardChunk:
        first, *others = pieces
        if not others:
            return first
        for board, piece in zip(self._boards[1:], others, strict=True):
            if piece.first_sample != first.first_sample:
                raise OverrunError(
                    f"{board.info.name} is not in step with {self._boards[0].info.name}: its "
                    f"sample {piece.first_sample} arrived with sample {first.first_sample}; "
                    f"start again"
                )
        if not first.first_sample:
            self._agreement = tuple(self._compared(pieces))
        volts = np.concatenate([piece.volts for piece in pieces])
        return BoardChunk(first.first_sample, first.time_s, volts)

    def _compared(self, pieces: list[BoardChunk]) -> Iterator[ClockAgreement]:
        first = self._boards[0].info
        for board, piece in zip(self._boards[1:], pieces[1:], strict=True):
            info = board.info
            one_clock = info.name in self._clocked or first.name in self._clocked
            if not one_clock and not (info.simulated and info.product == first.product):
                offset_s = piece.time_s - pieces[0].time_s
                yield ClockAgreement(info.name, first.name, offset_s, self._drift_ppm)
