"""The audit trail of a platform: movements, refusals and stops, and every call of a client."""

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Self

from PySide6.QtCore import QStandardPaths

from cosmic.app.platform import Platform
from cosmic.frame.audit import BEGUN, DONE, REFUSED, AuditEntry, AuditTrail, verdict_of
from cosmic.frame.network.host import KEYS
from cosmic.frame.network.invoker import Ended
from cosmic.frame.network.station import Station
from cosmic.frame.network.travelling_errors import from_plain
from cosmic.mico.api.application import MicoApplication
from cosmic.mico.api.mico import Mico
from cosmic.mico.api.news import AxisBegun, AxisEnded, AxisRefused, MovementNews
from cosmic.mico.core.motion.stop_latch import StopState

LOCAL = "local"
GATE = "gate"


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

    def join(self, station: Station) -> Callable[[], None]:
        """Write the calls of all clients of a station; returns the function that ends it."""
        undo = ExitStack()
        for name, invoker in station.invokers.items():
            undo.callback(invoker.ended.subscribe(self._taker(name)))
        return undo.close

    def _taker(self, application: str) -> Callable[[Ended], None]:
        def take(ended: Ended) -> None:
            if ended.found.mark.reads:
                return
            verdict, why = verdict_of(ended.error)
            what = f"{application}.{ended.found.name}"
            said = _said(ended.arguments)
            self._trail.note(
                AuditEntry(ended.caller.name, ended.caller.door, what, verdict, why, said)
            )

        return take

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
        found = axes.stop_state
        if found == self._stop:
            return
        self._stop = found
        what = "stop" if found.reason is not None else "reset of the stop"
        self._trail.note(AuditEntry("?", LOCAL, what, DONE, found.reason or ""))

    def _end(self) -> None:
        self._trail.request_end()
        self._trail.join()


def _said(arguments: Mapping[str, object]) -> dict[str, str]:
    return {
        ("of" if name == KEYS else name): repr(value)[:200]
        for name, value in arguments.items()
        if name == KEYS or name[0] not in "@#"
    }
