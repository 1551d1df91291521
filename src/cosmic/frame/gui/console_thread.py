"""The Python interpreter of the console, in a thread of its own."""

import code
import dis
import logging
import sys
import sysconfig
import threading
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from enum import Enum, auto
from functools import lru_cache
from pathlib import Path
from queue import SimpleQueue
from types import CodeType, FrameType
from typing import TYPE_CHECKING, Final

from PySide6.QtCore import QObject, Signal
from typing_extensions import override

from cosmic.frame.errors import CosmicError
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.gui.console_streams import OutputBuffer, ThreadStreams
from cosmic.frame.threads import WorkerThread

if TYPE_CHECKING:
    from _typeshed import TraceFunction

logger = logging.getLogger(__name__)

CONSOLE_FILE: Final = "<console>"
_LIBRARIES: Final = (
    *(sysconfig.get_path(name) for name in ("stdlib", "platstdlib", "purelib", "platlib")),
    str(Path(__file__).resolve().parents[2]),
)


class Interrupter:
    """Raises KeyboardInterrupt in the thread that runs the user's code.

    Only lines that the user wrote are broken: those of the console and of modules outside the
    libraries and CoSMic. A library is never left in the middle of what it does, with a lock
    held for instance; what waits in there is ended by whoever owns the wait.
    """

    def __init__(self) -> None:
        self._wanted = threading.Event()

    @property
    def wanted(self) -> bool:
        """True from `request` until the code was broken."""
        return self._wanted.is_set()

    def request(self) -> None:
        """Break the code that runs; any thread."""
        self._wanted.set()

    def clear(self) -> None:
        """Forget a request that came when nothing ran."""
        self._wanted.clear()

    def sleep(self, duration_s: float) -> None:
        """Wait in such a way that an interrupt ends it."""
        if self._wanted.wait(max(0.0, duration_s)):
            self._break()

    @contextmanager
    def watching(self) -> Iterator[None]:
        """Make what the calling thread runs inside interruptible."""
        before = sys.gettrace()
        sys.settrace(self._on_call)
        try:
            yield
        finally:
            sys.settrace(before)

    def _on_call(self, frame: FrameType, event: str, arg: object) -> "TraceFunction | None":
        if not _is_users(frame.f_code.co_filename):
            return None
        # A loop on one instruction, as ``while True: pass``, never comes to another line.
        frame.f_trace_opcodes = _turns_on_itself(frame.f_code)
        return self._on_line(frame, event, arg)

    def _on_line(self, frame: FrameType, event: str, arg: object) -> "TraceFunction | None":  # noqa: ARG002
        if self._wanted.is_set():
            self._break()
        return self._on_line

    def _break(self) -> None:
        self._wanted.clear()
        raise KeyboardInterrupt


@lru_cache(maxsize=256)
def _turns_on_itself(code: CodeType) -> bool:
    return any(
        each.opname.startswith("JUMP") and each.argval == each.offset
        for each in dis.get_instructions(code)
    )


def _is_users(file: str) -> bool:
    if file.startswith("<"):
        return file.startswith(CONSOLE_FILE[:-1])
    return not file.startswith(_LIBRARIES)


PROMPT: Final = ">>> "
MORE: Final = "... "
READING: Final = "in> "
BUSY: Final = ""
CLOSE_TIMEOUT_S: Final = 2.0
_TRIES: Final = 10

_given_up: "list[ConsoleThread]" = []
"""Threads that did not end in time: destroying a running QThread would abort the process."""


class _Kind(Enum):
    RUN = auto()
    COMPLETE = auto()
    WAKE = auto()


@dataclass(frozen=True, slots=True)
class _Request:
    kind: _Kind
    text: str = ""


class ConsoleThread(WorkerThread):
    """Runs what is typed into the console; everything public is thread-safe and returns at once.

    Parameters
    ----------
    policy : FailurePolicy
        Told of defects of the console itself; what the user's code raises is shown to the user.
    namespace : mapping
        The names that the user finds, such as ``rig`` and ``cosmic``.
    on_interrupt : callable or None
        Ends what the user's code waits for, such as a movement; called by `interrupt`.
    """

    output_ready = Signal()
    """There is text to take; emitted once until it is taken."""
    prompt_changed = Signal(str)
    """PROMPT, MORE or READING while it waits for a line, BUSY while something runs."""
    completed = Signal(str, object)
    """The text asked for, and a tuple of what it could become."""

    def __init__(
        self,
        policy: FailurePolicy,
        namespace: Mapping[str, object] | None = None,
        on_interrupt: Callable[[], None] | None = None,
        parent: QObject | None = None,
    ) -> None:
        super().__init__("console", policy, parent)
        self._on_interrupt = on_interrupt
        self._interrupter = Interrupter()
        self._output = OutputBuffer()
        self._inbox: SimpleQueue[_Request] = SimpleQueue()
        self._namespace: dict[str, object] = {
            "__name__": "__console__",
            "sleep": self._interrupter.sleep,
            **(namespace or {}),
        }
        self._interpreter = _Interpreter(self._namespace, self._interrupter, self._write)
        self._streams: ThreadStreams | None = None
        self._prompt = BUSY

    @property
    def busy(self) -> bool:
        """True while the user's code runs."""
        return self._prompt in (BUSY, READING)

    def submit(self, text: str) -> None:
        """Run `text`, one line or a whole block, after what was submitted before."""
        self._inbox.put(_Request(_Kind.RUN, text))

    def complete(self, text: str) -> None:
        """Ask for what `text` could become; answered by `completed` unless code runs."""
        if not self.busy:
            self._inbox.put(_Request(_Kind.COMPLETE, text))

    def take_output(self) -> str:
        """Remove and return what was printed."""
        return self._output.take()

    def interrupt(self) -> None:
        """Break what runs, as Ctrl-C does, and what it waits for."""
        self._interrupter.request()
        self._inbox.put(_Request(_Kind.WAKE))
        if self.busy and self._on_interrupt is not None:
            self._on_interrupt()

    @override
    def request_end(self) -> None:
        self._output.close()
        super().request_end()
        if self.isRunning():
            self.interrupt()  # wakes it as well

    def shut_down(self, timeout_s: float = CLOSE_TIMEOUT_S) -> bool:
        """End the thread, breaking what runs; False where it could not be ended in time."""
        self.request_end()
        # Code that catches one interrupt, or was about to wait, meets the next.
        for _ in range(_TRIES):
            if self.join(timeout_s / _TRIES):
                return True
            self.interrupt()
        logger.warning("the code in the console did not end and was abandoned")
        if self._streams is not None:
            self._streams.restore()
        _given_up.append(self)
        return False

    @override
    def run_body(self) -> None:
        self._set_prompt(PROMPT)
        while not self.end_requested:
            self._obey(self._inbox.get())

    def _obey(self, request: "_Request") -> None:
        if request.kind is _Kind.RUN and not self.end_requested:
            self._run(request.text)
        elif request.kind is _Kind.COMPLETE:
            self._complete(request.text)
        elif request.kind is _Kind.WAKE:
            self._forget_block()

    def _forget_block(self) -> None:
        """End an interrupt that met no running code: it drops the block being typed."""
        if self._prompt == MORE and self._interrupter.wanted:
            self._interpreter.resetbuffer()
            self._write("KeyboardInterrupt\n")
            self._set_prompt(PROMPT)
        self._interrupter.clear()

    def _run(self, text: str) -> None:
        prompt = self._prompt
        self._set_prompt(BUSY)
        self._write(f"{prompt}{text}\n")
        self._streams = ThreadStreams(self._write, self._read_for_input)
        try:
            more = self._interpreter.run(text)
        finally:
            self._streams.restore()
        if not self.end_requested:
            self._set_prompt(MORE if more else PROMPT)

    def _read_for_input(self) -> str:
        """Return the next line for the user's own ``input()``."""
        self._set_prompt(READING)
        try:
            while not self._interrupter.wanted:
                request = self._inbox.get()
                if request.kind is _Kind.RUN:
                    self._write(f"{request.text}\n")
                    return f"{request.text}\n"
            self._interrupter.clear()
            raise KeyboardInterrupt
        finally:
            self._set_prompt(BUSY)

    def _complete(self, text: str) -> None:
        import rlcompleter  # loads readline, which only a console needs

        completer = rlcompleter.Completer(self._namespace)
        matches: list[str] = []
        while (match := completer.complete(text, len(matches))) is not None:
            matches.append(match)
        self.completed.emit(text, tuple(dict.fromkeys(matches)))

    def _set_prompt(self, prompt: str) -> None:
        self._prompt = prompt
        self.prompt_changed.emit(prompt)

    def _write(self, text: str) -> None:
        if self._output.put(text):
            self.output_ready.emit()


class _Interpreter(code.InteractiveConsole):
    """Runs source text and shows failures where it was typed."""

    def __init__(
        self,
        namespace: dict[str, object],
        interrupter: Interrupter,
        write: Callable[[str], None],
    ) -> None:
        super().__init__(namespace, CONSOLE_FILE)
        self._interrupter = interrupter
        self._write = write

    def run(self, text: str) -> bool:
        """Run a line or a block; True when more lines are needed."""
        try:
            if "\n" not in text:
                return self.push(text)
            more = self.runsource(f"{text}\n", CONSOLE_FILE, "exec")
        except KeyboardInterrupt:
            self._write("KeyboardInterrupt\n")
            more = False
        except SystemExit:
            self._write("The console stays open; File > Quit closes the program.\n")
            more = False
        self.buffer = text.split("\n") if more else []
        return more

    @override
    def runcode(self, code: CodeType) -> None:
        with self._interrupter.watching():
            super().runcode(code)

    @override
    def write(self, data: str) -> None:
        self._write(data)

    @override
    def showtraceback(self) -> None:
        """Show what went wrong here: for the hook of the process it would be a defect."""
        kind, error, trace = sys.exc_info()
        if isinstance(error, KeyboardInterrupt):
            self._write("KeyboardInterrupt\n")
        elif isinstance(error, CosmicError):
            self._write(f"{type(error).__name__}: {error}\n")
        else:
            own = trace.tb_next if trace is not None else None
            self._write("".join(traceback.format_exception(kind, error, own)))

    @override
    def showsyntaxerror(self, filename: str | None = None, **_kwargs: object) -> None:
        kind, error, _trace = sys.exc_info()
        self._write("".join(traceback.format_exception_only(kind, error)))
