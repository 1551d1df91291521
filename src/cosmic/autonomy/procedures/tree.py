"""What became of each part of a procedure, for windows and records."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from enum import StrEnum
from threading import Lock

from cosmic.autonomy.procedures.operation import OperationFailed
from cosmic.frame.clock import Clock
from cosmic.frame.events import Event, Unsubscribe

Path = tuple[int, ...]
"""Where a part stands in the tree: the number of the child at each level; the root is ()."""


class NodeState(StrEnum):
    """What a part of a procedure is at; the value is the word."""

    WAITING = "waiting"
    RUNNING = "running"
    QUEUED = "waits its turn"
    HOLDING = "holds"
    """What it needs to itself; `text` of the event names it."""
    VERIFYING = "verifying"
    DONE = "done"
    FAILED = "failed"
    ENDED = "ended"
    """By something else than itself: an abort, a guard, or a part beside it that failed."""
    UNDOING = "undoing"
    UNDONE = "undone"
    NOT_UNDONE = "not undone"


ENDS = frozenset({NodeState.DONE, NodeState.FAILED, NodeState.ENDED})
RUNNING_STATES = frozenset(
    {
        NodeState.RUNNING,
        NodeState.QUEUED,
        NodeState.HOLDING,
        NodeState.VERIFYING,
        NodeState.UNDOING,
    }
)
OPERATION = "operation"
"""Kind of a part that is no combination of others."""


@dataclass(frozen=True, slots=True)
class NodeEvent:
    """One change of one part.

    Attributes
    ----------
    path : tuple of int
        Where the part stands in the tree.
    name, kind : str
        Of the part; `kind` is "operation", or what combines others, such as "retry".
    state : NodeState
        What it is at now.
    attempt : int
        Which try it is, from 1, of the nearest retry above it.
    round : int
        Which round it is of the nearest repeat above it; 0 where there is none.
    started_s, ended_s : float or None
        Platform clock; `ended_s` is None until it has ended.
    duration_s : float
        From start to end, without the time it rested in a pause; 0 until it has ended.
    cause, text : str
        Why it failed; `text` may say what it waits for before. Empty otherwise.
    role : str
        Whose part it is, of those that do the same side by side; empty where there are none.
    """

    path: Path
    name: str
    kind: str
    state: NodeState
    attempt: int = 1
    round: int = 0
    started_s: float | None = None
    ended_s: float | None = None
    duration_s: float = 0.0
    cause: str = ""
    text: str = ""
    role: str = ""


@dataclass(frozen=True, slots=True)
class NodeView:
    """A part and all below it, at one moment, for drawing.

    Attributes
    ----------
    event : NodeEvent
        What happened to it last.
    duration_s : float
        How long it took, or has taken by now.
    children : tuple of NodeView
        The parts it combines.
    """

    event: NodeEvent
    duration_s: float
    children: "tuple[NodeView, ...]" = ()

    @property
    def name(self) -> str:
        """Name of the part."""
        return self.event.name

    @property
    def kind(self) -> str:
        """What it is: an operation, or how it combines others."""
        return self.event.kind

    @property
    def state(self) -> NodeState:
        """What it is at."""
        return self.event.state

    @property
    def attempt(self) -> int:
        """Which try it is."""
        return self.event.attempt

    def walk(self) -> "Iterator[NodeView]":
        """Return this one and all below it, from above to below."""
        yield self
        for child in self.children:
            yield from child.walk()


@dataclass(frozen=True, slots=True)
class Outline:
    """The shape of a tree: name and kind of a part, whose it is, and the parts below it."""

    name: str
    kind: str
    children: "tuple[Outline, ...]" = ()
    role: str = ""


class ProcedureTreeState:
    """Knows what each part is at, and tells of every change, in order.

    One thread writes; any thread reads.
    """

    def __init__(self, outline: Outline, clock: Clock) -> None:
        self._outline = outline
        self._clock = clock
        self._lock = Lock()
        self._events: dict[Path, NodeEvent] = {}
        self._rested_before: dict[Path, float] = {}
        self._rested_s = 0.0
        self._resting_since_s: float | None = None
        self._changed: Event[NodeEvent] = Event()
        self._lay_out(outline, ())

    def _lay_out(self, outline: Outline, path: Path) -> None:
        self._events[path] = NodeEvent(
            path, outline.name, outline.kind, NodeState.WAITING, role=outline.role
        )
        for number, child in enumerate(outline.children):
            self._lay_out(child, (*path, number))

    def subscribe(self, listener: Callable[[NodeEvent], object]) -> Unsubscribe:
        """Call `listener(event)` at each change, in the thread that makes it.

        Returns the function that ends it.
        """
        return self._changed.subscribe(listener)

    # What the run reports

    def begin(self, path: Path, attempt: int, round_: int) -> None:
        """Say that a part begins."""
        before = self._events[path]
        self._rested_before[path] = self._rested_s
        self._put(
            NodeEvent(
                path,
                before.name,
                before.kind,
                NodeState.RUNNING,
                attempt,
                round_,
                self._clock.now_s(),
                role=before.role,
            )
        )

    def change(self, path: Path, state: NodeState, text: str = "") -> None:
        """Say that a part that has begun is at something else."""
        before = self._events[path]
        self._put(replace(before, state=state, text=text or before.text))

    def end(self, path: Path, state: NodeState, failure: OperationFailed | None = None) -> None:
        """Say that a part has ended, and why."""
        before = self._events[path]
        now_s = self._clock.now_s()
        started_s = before.started_s if before.started_s is not None else now_s
        rested_s = self._rested_s - self._rested_before.get(path, 0.0)
        self._put(
            NodeEvent(
                path,
                before.name,
                before.kind,
                state,
                before.attempt,
                before.round,
                started_s,
                now_s,
                max(0.0, now_s - started_s - rested_s),
                failure.cause if failure is not None else "",
                failure.text if failure is not None else "",
                before.role,
            )
        )

    def reset(self, path: Path) -> None:
        """Forget what the parts below `path` were at: a new round begins."""
        with self._lock:
            for below, event in self._events.items():
                if len(below) > len(path) and below[: len(path)] == path:
                    self._events[below] = NodeEvent(
                        below, event.name, event.kind, NodeState.WAITING, role=event.role
                    )

    def rest(self, *, resting: bool) -> None:
        """Say that all rests in a pause, or goes on; what rests takes no time."""
        now_s = self._clock.now_s()
        with self._lock:
            if self._resting_since_s is not None:
                self._rested_s += now_s - self._resting_since_s
            self._resting_since_s = now_s if resting else None

    def _put(self, event: NodeEvent) -> None:
        with self._lock:
            self._events[event.path] = event
        self._changed.emit(event)

    # Reading

    def snapshot(self) -> NodeView:
        """Return the tree as it is now; any thread."""
        with self._lock:
            now_s = self._clock.now_s()
            since_s = self._resting_since_s
            rested_s = self._rested_s + (0.0 if since_s is None else now_s - since_s)
            return self._view(self._outline, (), now_s, rested_s)

    def _view(self, outline: Outline, path: Path, now_s: float, rested_s: float) -> NodeView:
        event = self._events[path]
        duration_s = event.duration_s
        if event.started_s is not None and event.ended_s is None:
            rested_s_here = rested_s - self._rested_before.get(path, 0.0)
            duration_s = max(0.0, now_s - event.started_s - rested_s_here)
        children = tuple(
            self._view(child, (*path, number), now_s, rested_s)
            for number, child in enumerate(outline.children)
        )
        return NodeView(event, duration_s, children)
