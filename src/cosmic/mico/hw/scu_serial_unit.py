"""One SCU on a serial line: what is sent when, and whose the next answer is.

One question or command is under way at a time, because 9600 baud are soon full; the rest waits
here, commands before questions. A stop waits for nothing: it is written at once, and whatever was
to move its channel and was not sent yet is thrown away. Whoever finds the line free sends what
waits, so that no thread ever waits for another one.
"""

import logging
from abc import abstractmethod
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from threading import Lock
from typing import Final, Protocol

from cosmic.frame.clock import WALL
from cosmic.frame.errors import CosmicError, DeviceError, DeviceFault, DeviceTimeout
from cosmic.mico.hw import scu_serial_text as text
from cosmic.mico.hw.addresses import where
from cosmic.mico.hw.interface import Channel, Event, Failed, OtherAnswer, Serial

logger = logging.getLogger(__name__)

MOST_TRIES: Final = 3
"""So often is a line sent that the unit says it did not understand, or a stop that it ignores."""
LOST_AFTER: Final = 3
"""So many answers in a row may stay away before the unit counts as lost."""
LONGEST_LINE: Final = 200
CHANNELS: Final = 3
_FAREWELL: Final = b":SRC0R0\n:SRC1R0\n:SRC2R0\n:K0\n:E0\n"
"""No reports, no dead-man's switch, no answers to commands."""


class SerialLike(Protocol):
    """What is used of `serial.Serial`; failures are `OSError`, which `SerialException` is."""

    @property
    @abstractmethod
    def in_waiting(self) -> int:
        """Bytes that have arrived."""

    @abstractmethod
    def read(self, size: int = 1) -> bytes:
        """Return up to `size` bytes; fewer, or none, after the port's own short time-out."""

    @abstractmethod
    def write(self, data: bytes, /) -> int | None:
        """Send."""

    @abstractmethod
    def close(self) -> None:
        """Give the port back."""


@dataclass(eq=False, slots=True)
class Line:
    """One line to be sent, and what its answer is.

    Attributes
    ----------
    question : Question or None
        None of a command, whose answer is an error code.
    optional : bool
        A command that old firmware may not know.
    moves, stops : bool
        What it does to its channel.
    asked, number : int
        How many lines had been sent when it was asked, and when it was sent.
    """

    said: str
    at: Channel
    question: text.Question | None = None
    optional: bool = False
    moves: bool = False
    stops: bool = False
    asked: int = 0
    tries: int = 0
    sent_s: float = 0.0
    number: int = 0


@dataclass(slots=True)
class Unit:
    """An open unit. `command`, `ask` and `stop` from any thread, `receive` from one.

    Attributes
    ----------
    index : int
        Its place in the list of devices.
    answer_s : float
        How long an answer may take, in wall time.
    keep_alive_s : float
        Silence after which the unit stops everything by itself; 0 for never.
    """

    index: int
    port: SerialLike
    name: str
    answer_s: float
    keep_alive_s: float = 0.0
    serial: Serial = 0
    firmware: str = ""
    channels: int = CHANNELS
    echoes: bool = False
    _urgent: deque[Line] = field(default_factory=deque)
    _commands: deque[Line] = field(default_factory=deque)
    _questions: deque[Line] = field(default_factory=deque)
    _unanswered: deque[Line] = field(default_factory=deque)
    _events: deque[Event] = field(default_factory=deque)
    _free: Lock = field(default_factory=Lock)
    _sent: int = 0
    _stopped: dict[int, int] = field(default_factory=dict)
    _known: dict[tuple[int, str], tuple[int, str]] = field(default_factory=dict)
    _echo: deque[str] = field(default_factory=deque)
    _rest: bytes = b""
    _missed: int = 0
    _spoke_s: float = 0.0
    _gone: DeviceError | None = None

    # Any thread

    def command(
        self, at: Channel, said: str, *, moves: bool = False, optional: bool = False
    ) -> None:
        """Send a command as soon as the line is free."""
        self._check_there()
        self._commands.append(Line(said, at, moves=moves, optional=optional))
        self.pump()

    def ask(self, at: Channel, question: text.Question) -> None:
        """Ask as soon as the line is free; questions of a channel are answered in their order."""
        self._check_there()
        said = f"{question.command}{at.channel}"
        self._questions.append(Line(said, at, question, asked=self._sent))
        self.pump()

    def stop(self, at: Channel) -> None:
        """Stop a channel now; what was to move it and was not sent yet never is."""
        self._check_there()
        self._urgent.append(Line(f"S{at.channel}", at, stops=True))
        self.pump()

    def pump(self) -> None:
        """Send what may be sent, unless another thread is about to."""
        while self._has_work() and self._free.acquire(blocking=False):
            try:
                for line in self._sendable():
                    self._write(line)
            finally:
                self._free.release()

    def _has_work(self) -> bool:
        waiting = bool(self._commands or self._questions) and not self._unanswered
        return self._gone is None and (bool(self._urgent) or waiting)

    def _sendable(self) -> Iterator[Line]:
        while self._urgent:
            stop = self._urgent.popleft()
            # A copy, made in one go: other threads add to the queue meanwhile.
            waiting = tuple(self._commands)
            dropped = [each for each in waiting if each.moves and each.at == stop.at]
            for each in dropped:
                logger.info("%s: %s was not sent: a stop came first", self.name, each.said)
                self._commands.remove(each)
            yield stop
        while not self._unanswered and self._commands:
            line = self._commands.popleft()
            again = line.moves and line.tries > 0
            if again and self._stopped.get(line.at.channel, 0) > line.number:
                logger.info("%s: %s was not sent again: a stop came", self.name, line.said)
                continue
            yield line
            break
        while not self._unanswered and self._questions:
            line = self._questions.popleft()
            known = self._known.get((line.at.channel, line.said))
            if known is not None and known[0] > line.asked:
                self._take_answer(line, known[1])  # it was put again before this was answered
            else:
                yield line

    def _write(self, line: Line) -> None:
        line.tries += 1
        line.sent_s = self._spoke_s = WALL.now_s()
        if line.question is None:
            self._forget(line.at)
        self._sent += 1
        line.number = self._sent
        if line.stops:
            self._stopped[line.at.channel] = line.number
        self._unanswered.append(line)
        if self.echoes:
            self._echo.append(line.said)
        try:
            self.port.write(f":{line.said}\n".encode("ascii"))
        except OSError as exc:
            self._lose(exc)

    def _forget(self, at: Channel) -> None:
        """Forget what a channel answered before a command: it may be otherwise after that."""
        for key in list(self._known):
            if key[0] == at.channel:
                self._known.pop(key, None)

    def _lose(self, exc: OSError) -> None:
        here = where(self.index, serial=self.serial)
        said = f"{here}: the line {self.name} is lost ({exc}); check cable and power, then rescan"
        fault = DeviceFault.COMMUNICATION
        self._gone = self._gone or DeviceError(said, fault=fault, device=self.index)

    def _check_there(self) -> None:
        if self._gone is not None:
            raise self._gone

    # The thread that receives

    def receive(self, timeout_s: float) -> Event | None:
        """Return the next event, or None after `timeout_s` of wall time.

        Raises
        ------
        DeviceError
            The line is gone, or the unit does not answer any more.
        """
        until_s = WALL.now_s() + timeout_s
        while True:
            self._check_there()
            if self._events:
                return self._events.popleft()
            self._keep_alive()
            self.pump()
            if not self._events:
                self._read()
                self._look_at_clock()
            if not self._events and WALL.now_s() >= until_s:
                self._check_there()
                return None

    def _read(self) -> None:
        try:
            data = self.port.read(max(1, min(self.port.in_waiting, LONGEST_LINE)))
        except OSError as exc:
            self._lose(exc)
            return
        for said in self.lines(data):
            logger.debug("%s: %r", self.name, said)
            self._take(said)
        self.pump()

    def lines(self, data: bytes) -> Iterator[str]:
        """Take bytes and return the texts of the whole lines among them.

        What comes before the last colon of a line is garbage, or a line whose end was lost.
        """
        *whole, self._rest = (self._rest + data).split(b"\n")
        self._rest = self._rest[-LONGEST_LINE:]
        for each in whole:
            before, colon, said = each.rpartition(b":")
            if before:
                logger.warning("%s: threw away %r", self.name, before)
            if colon and said:
                yield said.decode("ascii", "replace").rstrip("\r")

    def _take(self, said: str) -> None:
        if self._echo and said == self._echo[0]:
            self._echo.popleft()
            return
        event = text.unasked(said, self.index, self.serial)
        if event is not None:
            self._events.append(event)
            return
        if not self._unanswered:
            logger.warning("%s: nobody asked for %r", self.name, said)
            return
        line = self._unanswered[0]
        if not self._fits(line, said):
            logger.warning("%s: %r is not an answer to %s", self.name, said, line.said)
            return
        self._unanswered.popleft()
        self._missed = 0
        if text.error_code(said) in text.GARBLED and line.tries < MOST_TRIES:
            logger.warning("%s: %s was not understood and is sent again", self.name, line.said)
            (self._urgent if line.stops else self._lane(line)).appendleft(line)
            return
        if line.question is not None:
            self._known[line.at.channel, line.said] = (line.number, said)
        self._take_answer(line, said)

    def _lane(self, line: Line) -> deque[Line]:
        return self._commands if line.question is None else self._questions

    @staticmethod
    def _fits(line: Line, said: str) -> bool:
        """Return whether `said` can be the answer to `line`; what comes late is not."""
        code = text.error_code(said)
        if line.question is None:
            return code is not None
        return bool(code) or (code is None and line.question.read(said, line.at) is not None)

    def _take_answer(self, line: Line, said: str) -> None:
        code = text.error_code(said)
        if line.question is not None and code is None:
            event = line.question.read(said, line.at)
            if event is not None:
                self._events.append(event)
        elif code and line.optional:
            self._events.append(OtherAnswer(line.at, f"{line.said} is not known to the unit"))
        elif code:
            error = text.code_error(code, line.said, line.at, serial=self.serial)
            self._events.append(Failed(line.at, error))

    def _look_at_clock(self) -> None:
        """Give up waiting for an answer that does not come."""
        if not self._unanswered:
            return
        line = self._unanswered[0]
        waited_s = WALL.now_s() - line.sent_s
        if waited_s <= self.answer_s:
            return
        self._unanswered.popleft()
        self._missed += 1
        here = where(self.index, line.at.channel, serial=self.serial)
        said = f"{here}: {line.said} was not answered within {self.answer_s:g} s"
        logger.warning("%s", said)
        error = DeviceTimeout(
            said, fault=DeviceFault.TIMEOUT, device=self.index, channel=line.at.channel
        )
        if self._missed >= LOST_AFTER:
            self._gone = error
        elif line.stops:
            self._urgent.append(line)
        elif line.question is None:
            self._events.append(Failed(line.at, error))  # nobody knows whether it was carried out

    def _keep_alive(self) -> None:
        """Say that this program still lives, where it has been silent for a while."""
        quiet_s = WALL.now_s() - self._spoke_s
        if self.keep_alive_s > 0.0 and quiet_s > self.keep_alive_s / 3.0 and not self._unanswered:
            whole = Channel(self.index, text.WHOLE_UNIT)
            self._commands.append(Line("K", whole, optional=True))

    # Before anybody else uses it

    def converse(self, said: str, fits: Callable[[str], str | None]) -> str:
        """Send a line and return what `fits` makes of the answer; while nothing else goes on.

        Raises
        ------
        DeviceError
            The line is gone, or there was no such answer in time.
        """
        try:
            self.port.write(f":{said}\n".encode("ascii"))
            until_s = WALL.now_s() + self.answer_s
            while WALL.now_s() < until_s:
                for each in self.lines(self.port.read(max(1, self.port.in_waiting))):
                    found = fits(each)
                    if found is not None:
                        return found
                    self.echoes = self.echoes or each == said
        except OSError as exc:
            self._lose(exc)
            self._check_there()
        raise DeviceTimeout(
            f"{self.name}: {said} was not answered within {self.answer_s:g} s; is it an SCU with "
            f"RS-232 firmware, and is the baud rate right?",
            fault=DeviceFault.TIMEOUT,
            device=self.index,
        )

    def close(self) -> None:
        """Leave the unit as other programs expect it, and give the line back; never raises."""
        fault, gone = DeviceFault.STATE, self._gone
        self._gone = DeviceError(f"{self.name} was closed", fault=fault, device=self.index)
        try:
            if gone is None:
                self.port.write(_FAREWELL)
            self.port.close()
        except (OSError, CosmicError) as exc:
            logger.debug("%s: closing: %s", self.name, exc)
