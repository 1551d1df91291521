"""`GateProcess`: asks the gate's own process, and replaces it when it fails."""

import logging
import pickle
from collections import deque
from collections.abc import Iterator, Mapping, Set
from contextlib import contextmanager
from dataclasses import replace
from threading import Lock
from types import NoneType
from typing import Final, TypeVar

from cosmic.frame.clock import WALL
from cosmic.frame.errors import CosmicError
from cosmic.frame.forked import FORKED
from cosmic.frame.helper_process import (
    PROTOCOL,
    HelperFaultError,
    HelperLateError,
    HelperProcess,
    HelperRefusalError,
)
from cosmic.mico.core.collision.answer import Approach, SweepAnswer
from cosmic.mico.core.collision.checker import Spans, pack_spans
from cosmic.mico.core.collision.model import BodyPair, SceneModel

logger = logging.getLogger(__name__)

MODULE: Final = "cosmic.mico.core.collision.helper"
MOST_FAILURES: Final = 5
FAILURES_WITHIN_S: Final = 10.0
_LOOK_S: Final = 0.02
PROMPT_S: Final = 0.002
"""How long whoever has something else to do waits for an answer; most come ten times sooner."""
T = TypeVar("T")

NOBODY: Final[frozenset[BodyPair]] = frozenset()


class NoAnswerError(CosmicError):
    """The collision gate gave no answer, so the answer is no; the text says why."""


class LateAnswerError(NoAnswerError):
    """The answer did not come in time; the text says within which."""


class GateProcess:
    """The pure gate in a process of its own; any thread.

    A process that dies is seen at once by its pipe. One that is only slow, on a busy computer, is
    waited for until `answer_s`; then it counts as hanging. Whoever waits can be stopped meanwhile.

    A process that dies, hangs or answers nonsense costs the question that met it a
    `NoAnswerError` and is replaced at once; until the new one has loaded the scene, questions
    are answered with `NoAnswerError` without waiting. After five failures within ten seconds it
    stays down until `start` is called again.

    Parameters
    ----------
    answer_s : float
        How long to wait for an answer, in wall time; see `WatchSettings.collision_answer_s`.
    start_s : float
        How long the process may take to come up.
    handlers : mapping of str
        "module:function" by kind of question for `ask`; each function is called there with the
        `Sweep` and the payload.
    """

    def __init__(
        self,
        model: SceneModel,
        *,
        answer_s: float = 5.0,
        start_s: float = 15.0,
        handlers: Mapping[str, str] | None = None,
    ) -> None:
        self._scene = pickle.dumps(replace(model, views=()), protocol=PROTOCOL)  # views: only drawn
        self._answer_s = answer_s
        self._start_s = start_s
        self._handlers = [f"{kind}={place}" for kind, place in (handlers or {}).items()]
        self._lock = Lock()
        self._helper: HelperProcess | None = None
        self._down = "it was not started"
        self._failures: deque[float] = deque(maxlen=MOST_FAILURES)
        self._restarts = 0
        self._closing = False

    @property
    def alive(self) -> bool:
        """Whether it runs and has loaded the scene."""
        helper = self._helper
        return helper is not None and helper.ready and helper.running

    @property
    def pid(self) -> int | None:
        """Number of the process, None while there is none."""
        helper = self._helper
        return None if helper is None else helper.pid

    @property
    def restarts(self) -> int:
        """How often it was replaced."""
        return self._restarts

    @property
    def busy(self) -> bool:
        """Whether somebody asks it just now."""
        return self._lock.locked()

    # Start and end

    def start(self) -> None:
        """Start the process and wait until it can be asked; forgets earlier failures.

        Raises
        ------
        NoAnswerError
            It does not come up; questions are refused until this is called again.
        """
        with self._lock:
            self._closing = False
            self._down = ""
            self._failures.clear()
            if self._helper is not None and not self._helper.running:
                self._end_helper()
            if self._helper is None:
                self._launch()
        until_s = WALL.now_s() + self._start_s
        while not self._came_up():
            if WALL.now_s() > until_s:
                with self._lock:
                    self._stay_down(f"it did not come up within {self._start_s:g} s")
                    raise NoAnswerError(self._down)

    def _came_up(self) -> bool:
        """Look a moment whether the process is ready, so that nobody waits for the lock long."""
        with self._lock:
            if self._down or self._helper is None:
                raise NoAnswerError(self._down or "it could not be started")
            try:
                return self._helper.poll_ready(_LOOK_S)
            except HelperFaultError as exc:
                self._stay_down(str(exc))
                raise NoAnswerError(self._down) from exc

    def close(self) -> None:
        """End the process, also under a question that waits; harmless the second time."""
        self._closing = True
        helper = self._helper
        if helper is not None:
            helper.kill()
        with self._lock:
            self._end_helper()
            self._down = "it was closed"

    # Questions

    def check(self, spans: Spans, ignored: Set[BodyPair] = NOBODY) -> SweepAnswer:
        """Ask `Sweep.check`.

        Raises
        ------
        NoAnswerError
            There is no answer.
        """
        return self._ask("check", (pack_spans(spans), ignored), self._answer_s, SweepAnswer)

    def check_promptly(
        self, spans: Spans, ignored: Set[BodyPair] = NOBODY, within_s: float = PROMPT_S
    ) -> SweepAnswer | None:
        """Ask `Sweep.check` as `check` does; None where the answer takes longer than `within_s`.

        The answer that is on its way is that to the same question put next.

        Raises
        ------
        NoAnswerError
            There is no answer.
        """
        if not self._lock.acquire(timeout=within_s):
            return None
        try:
            question = pack_spans(spans), ignored
            with self._answering(self._answer_s):
                answer = self._usable().ask_promptly("check", question, self._answer_s, within_s)
                if answer is None or isinstance(answer, SweepAnswer):
                    return answer
                raise HelperFaultError(f"its answer is a {type(answer).__name__}")
        finally:
            self._lock.release()

    def nearest(
        self, positions: Mapping[str, float], ignored: Set[BodyPair] = NOBODY
    ) -> Approach | None:
        """Ask `Sweep.nearest`.

        Raises
        ------
        NoAnswerError
            There is no answer.
        """
        payload = (dict(positions), ignored)
        return self._ask("nearest", payload, self._answer_s, Approach, NoneType)

    def clear_travel(
        self, spans: Spans, axis: str, ignored: Set[BodyPair] = NOBODY
    ) -> float | None:
        """Return how far `axis` may go towards the refused end of its span, in its unit.

        Raises
        ------
        NoAnswerError
            There is no answer.
        """
        payload = (pack_spans(spans), axis, ignored)
        return self._ask("clear_travel", payload, self._answer_s, float, NoneType)

    def ask(self, kind: str, payload: object, timeout_s: float | None = None) -> object:
        """Put a question of any kind that the process knows and return the answer.

        Raises
        ------
        NoAnswerError
            There is no answer within `timeout_s` (`answer_s` unless told).
        """
        return self._ask(kind, payload, self._answer_s if timeout_s is None else timeout_s, object)

    def _ask(self, kind: str, payload: object, timeout_s: float, *expected: type[T]) -> T:
        with self._turn(timeout_s), self._answering(timeout_s):
            answer = self._usable().ask(kind, payload, timeout_s)
            if not isinstance(answer, expected):
                raise HelperFaultError(f"its answer is a {type(answer).__name__}")
            return answer

    @contextmanager
    def _answering(self, timeout_s: float) -> Iterator[None]:
        """Turn what goes wrong with the process into `NoAnswerError`, and replace it."""
        try:
            yield
        except HelperRefusalError as exc:
            raise NoAnswerError(str(exc)) from exc
        except HelperFaultError as exc:
            self._replace(str(exc))
            if isinstance(exc, HelperLateError):
                raise LateAnswerError(f"within {timeout_s:g} s") from exc
            raise NoAnswerError(f"{exc}; {self._down or 'it is being restarted'}") from exc

    @contextmanager
    def _turn(self, timeout_s: float) -> Iterator[None]:
        if not self._lock.acquire(timeout=timeout_s):
            raise LateAnswerError(f"within {timeout_s:g} s; it was busy")
        try:
            yield
        finally:
            self._lock.release()

    # Replacing; all under the lock

    def _usable(self) -> HelperProcess:
        """Return the process if it can be asked now."""
        if self._closing:
            raise NoAnswerError("it was closed")
        if self._down:
            raise NoAnswerError(self._down)
        if self._helper is None:
            self._launch()
        helper = self._helper
        if helper is not None and helper.foreign:
            raise NoAnswerError(FORKED)
        try:
            if helper is not None and helper.poll_ready(0.0):
                return helper
            if helper is not None and WALL.now_s() - helper.began_s > self._start_s:
                self._replace(f"it did not come up within {self._start_s:g} s")
        except HelperFaultError as exc:
            self._replace(str(exc))
        raise NoAnswerError(self._down or "it is being restarted")

    def _launch(self) -> None:
        try:
            self._helper = HelperProcess(MODULE, self._scene, self._handlers)
        except OSError as exc:
            self._helper = None
            logger.error("the collision gate's process cannot be started: %s", exc)
            self._count_failure(f"cannot be started ({exc})")

    def _replace(self, why: str) -> None:
        """Put a new process in the place of one that failed, unless too many did."""
        if self._closing:
            self._down = "it was closed"
            return
        words = self._end_helper()
        logger.warning("the collision gate's process failed: %s; it is replaced\n%s", why, words)
        self._count_failure(why)
        if not self._down:
            self._restarts += 1
            self._launch()

    def _count_failure(self, why: str) -> None:
        now_s = WALL.now_s()
        self._failures.append(now_s)
        full = len(self._failures) == MOST_FAILURES
        if full and now_s - self._failures[0] <= FAILURES_WITHIN_S:
            self._stay_down(f"it failed {MOST_FAILURES} times in a row, last because {why}")

    def _stay_down(self, why: str) -> None:
        words = self._end_helper()
        self._down = f"{why}; it stays down. Press Rescan"
        logger.error("the collision gate's process is down: %s\n%s", self._down, words)

    def _end_helper(self) -> str:
        helper, self._helper = self._helper, None
        return "" if helper is None else helper.end()
