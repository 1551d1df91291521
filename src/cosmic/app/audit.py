"""The audit trail of a platform: movements, refusals and stops, and every call of a client."""

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from threading import Lock
from types import TracebackType
from typing import Self

from PySide6.QtCore import QStandardPaths

from cosmic.app.gateways.approvals import Approvals, Asked
from cosmic.app.platform import Platform
from cosmic.frame.audit import BEGUN, DONE, REFUSED, AuditEntry, AuditTrail, verdict_of
from cosmic.frame.clock import WALL
from cosmic.frame.errors import CosmicError
from cosmic.frame.network.host import KEYS
from cosmic.frame.network.invoker import Ended
from cosmic.frame.network.lease import LeaseState
from cosmic.frame.network.ongoing import Ended as OperationEnded
from cosmic.frame.network.ongoing import Ongoing
from cosmic.frame.network.station import Station
from cosmic.frame.network.travelling_errors import from_plain
from cosmic.frame.verdict import MoveVerdict
from cosmic.mico.api.application import MicoApplication
from cosmic.mico.api.mico import Mico
from cosmic.mico.api.news import AxisBegun, AxisEnded, AxisRefused, MovementNews
from cosmic.mico.core.motion.stop_latch import StopState

LOCAL = "local"
GATE = "gate"
STATION = "station"
MOST_REFUSED_S = 20.0
"""So many refusals of clients are written a second: a flood must not push out what was before."""


def audit_file() -> Path:
    """Return where the trail of this computer is kept."""
    place = QStandardPaths.StandardLocation.GenericStateLocation
    return Path(QStandardPaths.writableLocation(place)) / "CoSMic" / "audit.jsonl"


class PlatformAudit:
    """Writes what is commanded on a platform; a context, open from `__enter__` on."""

    def __init__(self, platform: Platform, path: Path) -> None:
        self._platform = platform
        self._trail = AuditTrail(path, platform.policy)
        self._undo = ExitStack()
        self._stop = StopState(None, 0)
        self._refusals = _Refusals()

    @property
    def path(self) -> Path:
        """Where it is written."""
        return self._trail.path

    def __enter__(self) -> Self:
        self._trail.start()
        self._undo.callback(self._end)
        mico = self._platform.own.get("mico")
        if isinstance(mico, MicoApplication):
            axes = Mico(mico, "audit")
            self._undo.callback(axes.follow_movements(self._on_movement))
            self._undo.callback(axes.on_change(lambda: self._look(axes)))
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._undo.close()

    def join(self, station: Station, approvals: Approvals | None = None) -> Callable[[], None]:
        """Write the calls of all clients of a station; returns the function that ends it.

        Who has the right to move is written as well, and what a person here approves.
        """
        undo = ExitStack()
        undo.callback(station.lease.subscribe(self._on_lease))
        undo.callback(station.lease.refused.subscribe(self._on_refused_lease))
        if approvals is not None:
            undo.callback(approvals.decided.subscribe(self._on_decision))
        for name, invoker in station.invokers.items():
            undo.callback(invoker.ended.subscribe(self._taker(name)))
        return undo.close

    def _taker(self, application: str) -> Callable[[Ended], None]:
        def take(ended: Ended) -> None:
            mark = ended.found.mark
            if mark.reads or (mark.renews and ended.error is None):
                return  # a jog is kept alive many times a second
            caller, what = ended.caller, f"{application}.{ended.found.name}"
            said = _said(ended.arguments)
            goes_on = ended.goes_on
            if goes_on is None:
                verdict, why = verdict_of(ended.error)
                self._note(AuditEntry(caller.name, caller.door, what, verdict, why, said))
                return

            def note_end(over: Ongoing) -> None:
                verdict, why = verdict_of(_failure(over))
                self._note(AuditEntry(caller.name, caller.door, what, verdict, why, said))

            if not goes_on.done:
                self._note(AuditEntry(caller.name, caller.door, what, BEGUN, "", said))
            add_callback = getattr(goes_on, "add_callback", None)
            if add_callback is not None:
                add_callback(note_end)

        return take

    def _note(self, entry: AuditEntry) -> None:
        """Write what a client commanded; of refusals so many a second."""
        if entry.verdict == REFUSED:
            left_out = self._refusals.admit(WALL.now_s())
            if left_out is None:
                return
            if left_out:
                more = {"left_out": f"{left_out} refusals before this one"}
                entry = replace(entry, details={**entry.details, **more})
        self._trail.note(entry)

    def _on_refused_lease(self, name: str, verdict: MoveVerdict) -> None:
        why = f"{verdict.reason.name}: {verdict}"
        self._note(AuditEntry(name, STATION, "right to move", REFUSED, why))

    def _on_lease(self, found: LeaseState) -> None:
        self._trail.note(AuditEntry(found.holder, STATION, "right to move", DONE, found.why))

    def _on_decision(self, asked: Asked, approved: bool) -> None:
        verdict = DONE if approved else REFUSED
        said = {"for": asked.who, "command": asked.what, "arguments": asked.details}
        self._trail.note(AuditEntry("operator", LOCAL, "approval", verdict, "", said))

    def _on_movement(self, news: MovementNews) -> None:
        if isinstance(news, AxisBegun):
            said = {"motion": repr(news.motion)[:200]}
            entry = AuditEntry(news.source or "?", LOCAL, f"move {news.name}", BEGUN, "", said)
        elif isinstance(news, AxisRefused):
            verdict = news.verdict
            why = f"{verdict.reason.name}: {verdict}"[:500]
            entry = AuditEntry("?", GATE, f"move {verdict.axis or 'several'}", REFUSED, why)
        elif isinstance(news, AxisEnded):
            error = None if news.error is None else from_plain(news.error)
            word, why = verdict_of(error)
            said = {"position": f"{news.position}"}
            entry = AuditEntry("controller", LOCAL, f"move {news.name}", word, why, said)
        else:
            return
        self._trail.note(entry)

    def _look(self, axes: Mico) -> None:
        found, before = axes.stop_state, self._stop
        self._stop = found
        if found == before or (found.reason is None and before.reason is None):
            return  # closing halts all once more, which is no reset
        what = "stop" if found.reason is not None else "reset of the stop"
        self._trail.note(AuditEntry("?", LOCAL, what, DONE, found.reason or ""))

    def _end(self) -> None:
        self._trail.request_end()
        self._trail.join()


def _failure(over: Ongoing) -> Exception | None:
    """Return what a command failed with that has ended."""
    try:
        end = over.wait(0.0)
    except CosmicError as exc:
        return exc
    plain = end.error if isinstance(end, OperationEnded) else None
    return None if plain is None else from_plain(plain)


class _Refusals:
    """Lets so many through a second, and counts the others."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._free = MOST_REFUSED_S
        self._at_s = WALL.now_s()
        self._left_out = 0

    def admit(self, now_s: float) -> int | None:
        """Return how many were left out since the last that was let through; None: this one is."""
        with self._lock:
            gained = (now_s - self._at_s) * MOST_REFUSED_S
            self._free, self._at_s = min(MOST_REFUSED_S, self._free + gained), now_s
            if self._free < 1.0:
                self._left_out += 1
                return None
            self._free -= 1.0
            found, self._left_out = self._left_out, 0
            return found


def _said(arguments: Mapping[str, object]) -> dict[str, str]:
    return {
        ("of" if name == KEYS else name): repr(value)[:200]
        for name, value in arguments.items()
        if name == KEYS or name[0] not in "@#"
    }
