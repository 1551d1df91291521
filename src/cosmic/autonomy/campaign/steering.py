"""Pause, step and abort of a campaign, whatever it is at."""

import logging
from collections.abc import Callable
from enum import StrEnum
from threading import Condition
from typing import Final

from cosmic.autonomy.campaign.store_files import NotWrittenError
from cosmic.autonomy.handling.work import FibreWork
from cosmic.autonomy.procedures.run import ProcedureRun
from cosmic.autonomy.procedures.run_state import RunState
from cosmic.frame.clock import WALL
from cosmic.frame.listeners import tell

logger = logging.getLogger(__name__)

_POLL_S: Final = 0.2
AGAIN_WALL_S: Final = 2.0
"""How often it is tried to write what could not be written."""
PATIENCE_WALL_S: Final = 600.0
"""How long that is tried."""
WAITING: Final = "waits for room on the disk"


class CampaignPhase(StrEnum):
    """What a campaign is at; the value is the word.

    `ENDED`: what the recipe asks for is done. `STOPPED`: it ended before that, in order: by
    somebody's wish, by a stop, or because no fibre could be taken. `FAILED`: by a fault.
    """

    READY = "ready"
    RUNNING = "running"
    PAUSING = "pausing"
    PAUSED = "paused"
    ENDING = "ending"
    ENDED = "ended"
    STOPPED = "stopped"
    FAILED = "failed"


OVER: Final = frozenset({CampaignPhase.ENDED, CampaignPhase.STOPPED, CampaignPhase.FAILED})


class CampaignSteering:
    """What a campaign is at, and how it is steered; any thread."""

    def __init__(self) -> None:
        self._changed = Condition()
        self._phase = CampaignPhase.READY
        self._run: ProcedureRun[FibreWork] | None = None
        self._abort: str | None = None
        self._operation = ""
        self._listeners: tuple[Callable[[], object], ...] = ()

    @property
    def phase(self) -> CampaignPhase:
        """What it is at."""
        return self._phase

    @property
    def operation(self) -> str:
        """The operation under way, in words."""
        return self._operation

    @property
    def over(self) -> bool:
        """True when it has ended, well or not."""
        return self._phase in OVER

    @property
    def run(self) -> ProcedureRun[FibreWork] | None:
        """The run of the procedure on the fibre in hand, for drawing; None before the first."""
        return self._run

    def on_change(self, listener: Callable[[], object]) -> Callable[[], None]:
        """Call `listener()` when anything changed, in any thread; returns what ends it."""
        with self._changed:
            self._listeners = (*self._listeners, listener)

        def forget() -> None:
            with self._changed:
                self._listeners = tuple(each for each in self._listeners if each is not listener)

        return forget

    def pause(self) -> None:
        """Rest at the next place where that is safe; harmless when it does not run."""
        with self._changed:
            if self._phase is not CampaignPhase.RUNNING:
                return
            self._phase = CampaignPhase.PAUSING
            run = self._run
        if run is not None:
            run.pause()
        self._tell()

    def resume(self) -> None:
        """Go on after a pause; harmless when it does not pause."""
        with self._changed:
            if self._phase not in (CampaignPhase.PAUSING, CampaignPhase.PAUSED):
                return
            self._phase = CampaignPhase.RUNNING
            self._changed.notify_all()
            run = self._run
        if run is not None:
            run.resume()
        self._tell()

    def step(self) -> None:
        """Carry out one operation, then rest; harmless when it is over."""
        with self._changed:
            if self._phase in OVER or self._run is None or self._run.over:
                return
            self._phase = CampaignPhase.PAUSING
            run = self._run
        run.step()

    # For the campaign's own thread

    def _move_on(self, phase: CampaignPhase) -> CampaignPhase:
        """Be at another phase; returns the one before."""
        with self._changed:
            before, self._phase = self._phase, phase
            self._changed.notify_all()
        return before

    def _follow(self, run: ProcedureRun[FibreWork]) -> str | None:
        """Have this run steered from now on; returns why it must not begin, or None."""
        run.on_change(self._on_run_changed)
        with self._changed:
            self._run = run
            return self._abort

    def _rest(self) -> None:
        """Wait between two fibres while a pause is wanted."""
        with self._changed:
            if self._phase is CampaignPhase.PAUSING:
                self._phase = CampaignPhase.PAUSED
            resting = self._phase is CampaignPhase.PAUSED
        if not resting:
            return
        self._tell()
        with self._changed:
            while self._phase is CampaignPhase.PAUSED and self._abort is None:
                self._changed.wait(_POLL_S)

    def _insist(self, write: Callable[[], None]) -> None:
        """Write what must not be lost; where that fails, again and again while it may yet succeed.

        Raises
        ------
        NotWrittenError
            It was not written in `PATIENCE_WALL_S`, or before the end was wanted.
        """
        until_s = WALL.now_s() + PATIENCE_WALL_S
        before = self._operation
        while True:
            try:
                write()
                break
            except NotWrittenError as exc:
                if self._abort is not None or WALL.now_s() >= until_s:
                    raise NotWrittenError(f"the last fibre is not kept: {exc}") from exc
                if self._operation != WAITING:
                    self._operation = WAITING
                    logger.error("%s; it is tried again every %g s", exc, AGAIN_WALL_S)
                    self._tell()
            with self._changed:
                self._changed.wait(AGAIN_WALL_S)
        self._operation = before

    def _on_run_changed(self) -> None:
        run = self._run
        with self._changed:
            pausing = run is not None and self._phase is CampaignPhase.PAUSING
            if pausing and run is not None and run.state is RunState.PAUSED:
                self._phase = CampaignPhase.PAUSED
        if pausing and run is not None and run.state is RunState.RUNNING:
            run.pause()  # it was wanted while the run had not begun
        self._tell()

    def _tell(self) -> None:
        tell(self._listeners)
