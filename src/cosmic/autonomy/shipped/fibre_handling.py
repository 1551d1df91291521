"""`FibreHandling`: fibres handled by hand, one operation at a time, each a run of a procedure."""

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from threading import RLock
from typing import Final, Protocol, get_args

from typing_extensions import override

from cosmic.autonomy.coordinate_transform import NO_TABLE
from cosmic.autonomy.handling.context import Applications, HandlingContext, vision_of
from cosmic.autonomy.handling.held_fibre import HeldFibre
from cosmic.autonomy.handling.manual_operations import CloseGently, PushToForce, is_at_probe
from cosmic.autonomy.handling.marked import MarkedFibre, approach_to
from cosmic.autonomy.handling.settings import HandlingSettings
from cosmic.autonomy.procedures.failures import STOPPED
from cosmic.autonomy.procedures.procedure import Procedure
from cosmic.autonomy.procedures.run import ProcedureRun, RunState
from cosmic.autonomy.shipped.operation_procedures import (
    build_bring,
    build_carry_back,
    build_close_gently,
    build_lay_back,
    build_measure,
    build_push,
    build_put_away,
    build_retract,
    build_take,
)
from cosmic.autonomy.shipped.single_operation import (
    IN_DOUBT,
    PUSHES,
    UNDO_WORDS,
    OperationPreview,
    OperationRequest,
    OperationResult,
    interruption,
    outcome,
    untrusted,
)

# Recorded procedures that were written as scripts take it from here.
from cosmic.autonomy.shipped.single_operation import SingleOperation as SingleOperation
from cosmic.frame.errors import ConfigError, CosmicError, NotAvailable
from cosmic.frame.events import Event, Unsubscribe
from cosmic.mico.api.application import MicoApplication
from cosmic.mico.api.news import AxisEnded, MovementNews
from cosmic.mico.core.motion.positioner import positions_of

logger = logging.getLogger(__name__)

GRIPPERS: Final[tuple[str, ...]] = get_args(HandlingSettings.model_fields["gripper"].annotation)

MORE_ZOOM: Final = 1.05
"""So far beyond a zoom an image still counts as taken at it."""


class MakeRun(Protocol):
    """Makes a run of a procedure on a context, ready to begin."""

    def __call__(
        self, procedure: Procedure[HandlingContext], work: HandlingContext, /
    ) -> ProcedureRun[HandlingContext]:
        """Return it."""


@dataclass(slots=True, eq=False)
class HandlingState:
    """What all who handle fibres on one platform share."""

    contexts: dict[str, HandlingContext] = field(default_factory=dict)
    lock: RLock = field(default_factory=RLock)
    gripper: str = ""
    done: list[SingleOperation] = field(default_factory=list)
    run: ProcedureRun[HandlingContext] | None = None
    result: OperationResult | None = None
    request: OperationRequest | None = None
    changed: Event[[]] = field(default_factory=Event)


class FibreHandling:
    """One fibre at a time, handled by single operations; any thread.

    What is done here is what a campaign does, by the same operations. A fibre that one gripper
    holds must be put away, or laid back, before another one is taken.

    Parameters
    ----------
    rig : Applications
        The platform.
    make_run : callable
        Returns a run that ends when motion is stopped.
    busy : callable
        Returns what else runs on the platform, in words; empty for nothing.
    settings : HandlingSettings or None
        Of all operations; gripper and other are set by what is asked for.
    state : HandlingState or None
        That of another with which it shares everything; None: its own.

    Raises
    ------
    NotAvailable
        The cameras belong to another station.
    """

    def __init__(
        self,
        rig: Applications,
        make_run: MakeRun,
        busy: Callable[[], str],
        settings: HandlingSettings | None = None,
        state: HandlingState | None = None,
    ) -> None:
        self._rig, self._make_run, self._busy = rig, make_run, busy
        self._settings = settings or HandlingSettings()
        tools = {each.name: each for each in vision_of(rig.vico).settings.tool}
        self._grippers = tuple(name for name in GRIPPERS if name in tools and tools[name].gap_axis)
        self._state = state or HandlingState()
        self._forget_movements: Callable[[], None] = _nothing
        if state is None:
            self._forget_movements = rig.mico.follow_movements(self._on_movement)

    @override
    def __repr__(self) -> str:
        return f"<FibreHandling, {self.held_by or 'no gripper'} holds a fibre>"

    def commanding_by(self, rig: Applications) -> "FibreHandling":
        """Return the same, whose operations move axes by the name that `rig` commands by."""
        return FibreHandling(rig, self._make_run, self._busy, self._settings, self._state)

    # What is known

    @property
    def grippers(self) -> tuple[str, ...]:
        """Names of the grippers that can take a fibre."""
        return self._grippers

    @property
    def run(self) -> ProcedureRun[HandlingContext] | None:
        """The operation begun last; None before the first."""
        return self._state.run

    @property
    def request(self) -> OperationRequest | None:
        """What was asked for last; None before the first, and after a recorded procedure."""
        return self._state.request

    @property
    def running(self) -> bool:
        """True while an operation runs."""
        run = self._state.run
        return run is not None and not run.over and run.state is not RunState.READY

    @property
    def result(self) -> OperationResult | None:
        """How the operation before ended; None before the first has."""
        return self._state.result

    @property
    def fibre(self) -> HeldFibre | None:
        """The fibre that is held, with all that became known of it; None also where in doubt."""
        carried = self._carried
        return carried if carried is not None and not carried.doubted else None

    @property
    def held_by(self) -> str:
        """Which gripper holds a fibre; empty for none, and where that is in doubt."""
        return self._state.gripper if self.fibre is not None else ""

    @property
    def may_hold(self) -> str:
        """Which gripper was opened, by no operation, since it took a fibre; empty for none."""
        return self._state.gripper if self._carried is not None and self.fibre is None else ""

    @property
    def _carried(self) -> HeldFibre | None:
        """The fibre that was taken and not put away since."""
        work = self._state.contexts.get(self._state.gripper)
        fibre = work.fibre if work is not None else None
        return fibre if fibre is not None and fibre.held else None

    @property
    def at_probe(self) -> bool:
        """True where the held fibre is before the probe."""
        if self.fibre is None:
            return False
        try:
            return is_at_probe(self._state.contexts[self._state.gripper])
        except NotAvailable:
            return False

    @property
    def last(self) -> SingleOperation | None:
        """What Undo would take back; None where there is nothing."""
        return self._state.done[-1] if self._state.done else None

    def subscribe(self, listener: Callable[[], object]) -> Unsubscribe:
        """Call `listener()` when an operation began or ended, or a fibre is doubted; any thread."""
        return self._state.changed.subscribe(listener)

    # What can be done

    def why_not(self, request: OperationRequest) -> str:
        """Return why an operation cannot begin now; empty where it can. Nothing moves."""
        if self.running and self._state.run is not None:
            return f"{self._state.run.name} is running; wait until it has ended, or stop it"
        if other := self._busy():
            return f"{other} is running; end it first"
        if stopped := self._rig.mico.stop_state.reason:
            return f"motion is stopped ({stopped}); look at the tools, then press Reset"
        if request.operation is SingleOperation.TAKE:
            return self._why_not_take(request)
        if request.operation is SingleOperation.CLOSE:
            return self._why_no_gripper(request)
        return self._why_not_held(request)

    def _why_not_held(self, request: OperationRequest) -> str:
        if self._carried is None:
            return "no gripper holds a fibre; take one first"
        if request.operation is not SingleOperation.PUT_AWAY and (doubt := self._doubt()):
            return f"{doubt}; put it away first"
        if request.operation is SingleOperation.UNDO:
            return "" if self._state.done else "there is nothing to undo"
        most = self._settings.push.limit_un
        if request.operation is SingleOperation.PUSH and not 0.0 < request.force_un <= most:
            return f"{request.force_un:g} µN is not between 0 and {most:g} µN"
        if request.operation in PUSHES and not self.at_probe:
            return "the fibre is not before the probe; bring it to the probe first"
        return ""

    def _why_not_take(self, request: OperationRequest) -> str:
        if request.marked is None:
            return "no fibre is marked; find the fibres, and choose one in the image"
        if doubt := self._doubt():
            return f"{doubt}; put it away first"
        if self.fibre is not None:
            return f"{self._state.gripper} holds a fibre; put it away first"
        if not self._rig.vico.application.settings.table_axis:
            return NO_TABLE
        return self._why_no_gripper(request) or self._why_not_at_zoom(request, request.marked)

    def _doubt(self) -> str:
        """Return what is not known of the fibre that was taken, or nothing."""
        if not self.may_hold:
            return ""
        return f"{self._state.gripper} was opened since it took a fibre, and may hold it or not"

    def _why_not_at_zoom(self, request: OperationRequest, marked: MarkedFibre) -> str:
        """Return why a fibre cannot be found again from the zoom of its image, or nothing.

        What is measured before the first fibre is taken does not reach that far.
        """
        lens, counts = self._rig.vico.lens, marked.image.circumstances.zoom_counts
        if lens is None or counts is None or self._measured_at(request.gripper, marked):
            return ""
        settings = self._settings
        zoom = lens.scale.zoom(counts)
        if zoom is None or zoom <= MORE_ZOOM * max(
            settings.zoom, settings.calibration.compare_zoom
        ):
            return ""
        return (
            f"fibres are taken at {settings.zoom:g}x, and this one was found at {zoom:.3g}x; zoom "
            "out, then choose it again"
        )

    def _measured_at(self, gripper: str, marked: MarkedFibre) -> bool:
        """Tell whether the image of a fibre can be told as positions already."""
        work = self._state.contexts.get(gripper)
        if work is None:
            return False
        try:
            marked.on_platform(work)
        except NotAvailable:
            return False
        return True

    def _why_no_gripper(self, request: OperationRequest) -> str:
        if request.gripper in self.grippers:
            return ""
        known = ", ".join(self.grippers) or "none"
        return f"there is no gripper {request.gripper!r}; there are: {known}"

    def preview(self, request: OperationRequest) -> OperationPreview:
        """Return what an operation would do, or why it cannot begin; nothing moves."""
        if why := self.why_not(request):
            return OperationPreview(why)
        if request.operation is SingleOperation.TAKE and request.marked is not None:
            return self._preview_take(request.gripper, request.marked)
        if request.operation is SingleOperation.CLOSE:
            return OperationPreview(f"The jaws of {request.gripper} close slowly until they hold.")
        work = self._state.contexts[self._state.gripper]
        positions = work.settings.places
        now = positions_of(work.mico.states())
        away = {work.probe.y_axis: positions.probe_away_y_um - work.probe.tip_um[1]}
        if request.operation is SingleOperation.BRING:
            x = positions.hold_x_um * work.jaws.forward
            there = work.at(work.gripper, x, positions.hold_y_um, work.hold_tip_um)
            return OperationPreview(
                "The probe draws back, and the fibre is held before it.",
                (now, now | away, now | away | there),
            )
        if request.operation is SingleOperation.PUT_AWAY:
            there = work.bin_position(positions.bin_um)
            return OperationPreview(
                "The fibre is dropped into the bin, and the jaws are seen to be empty.",
                (now, now | away, now | away | there),
            )
        if request.operation is SingleOperation.UNDO:
            return OperationPreview(UNDO_WORDS[self._state.done[-1]], (now, now | away))
        words = (
            f"The probe pushes the fibre until it pushes back with {request.force_un:g} µN, and "
            "goes back."
            if request.operation is SingleOperation.PUSH
            else f"The probe pushes the fibre at up to {work.settings.push.spans.count} spans."
        )
        return OperationPreview(words)

    def _preview_take(self, gripper: str, marked: MarkedFibre) -> OperationPreview:
        try:
            work = self.context(gripper)
            approach = approach_to(work, marked)
        except CosmicError:
            words = f"The {gripper} gripper is calibrated first, for about a minute"
            return OperationPreview(f"{words}; then it takes this fibre.")
        if approach is None:
            return OperationPreview(f"{gripper} cannot reach this fibre at any angle of the table.")
        now = positions_of(work.mico.states())
        above = work.at(work.gripper, *approach.tip_um, work.settings.places.travel_um)
        turned = now | {work.table: approach.angle_deg}
        down = work.at(work.gripper, *approach.tip_um, work.grasp_um)
        return OperationPreview(
            f"The table turns to {approach.angle_deg:.0f}°, {gripper} comes down around the end of "
            "the fibre, closes and lifts it.",
            (now, turned, turned | above, turned | down),
        )

    def prepare(self, request: OperationRequest) -> ProcedureRun[HandlingContext]:
        """Return the run of an operation; begin it by `start` or `run_here`.

        Raises
        ------
        NotAvailable
            It cannot begin; the text says why, and nothing has moved.
        ConfigError
            The platform has no such tool, camera or force channel.
        """
        with self._state.lock:
            if why := self.why_not(request):
                raise NotAvailable(f"{request.title}: {why}")
            taking = request.operation is SingleOperation.TAKE
            own = taking or request.operation is SingleOperation.CLOSE
            work = self.context(request.gripper if own else self._state.gripper)
            push, closing = PushToForce(request.force_un), CloseGently()
            procedure = self._procedure(request, work, push, closing)
            if taking:
                self._state.gripper, self._state.done = request.gripper, []
                work.shared.surveyed = False
            self._state.request, doubted = request, bool(self.may_hold)
            return self._made(
                procedure, work, lambda run: self._on_end(request, run, push, closing, doubted)
            )

    def prepare_recorded(
        self,
        procedure: Procedure[HandlingContext],
        gripper: str,
        operations: tuple[SingleOperation, ...] = (),
        *,
        values: tuple[tuple[str, str], ...] = (),
    ) -> ProcedureRun[HandlingContext]:
        """Return the run of a procedure of many steps on the context of a gripper.

        Parameters
        ----------
        operations : tuple of SingleOperation
            Those among its steps, for `UNDO` to know what was done.
        values : tuple of (str, str)
            What it was given, a name and a value each, for its result.

        Raises
        ------
        NotAvailable
            Something else runs.
        ConfigError
            There is no such gripper.
        """
        with self._state.lock:
            if self.running or self._busy():
                what = self._busy() or "an operation"
                raise NotAvailable(f"{procedure.name}: {what} is running; end it first")
            if doubt := self._doubt():
                raise NotAvailable(f"{procedure.name}: {doubt}; put it away first")
            if self.fibre is not None and gripper != self._state.gripper:
                raise NotAvailable(f"{self._state.gripper} holds a fibre; put it away first")
            work = self.context(gripper)
            work.shared.surveyed = False
            self._state.gripper, self._state.request = gripper, None
            return self._made(
                procedure, work, lambda run: self._on_replayed(run, operations, values)
            )

    def _made(
        self,
        procedure: Procedure[HandlingContext],
        work: HandlingContext,
        on_end: Callable[[ProcedureRun[HandlingContext]], None],
    ) -> ProcedureRun[HandlingContext]:
        """Return a run that is followed to its end."""
        work.command_as(procedure.name, self._rig.mico)
        run = self._state.run = self._make_run(procedure, work)
        done = False

        def look() -> None:
            nonlocal done
            if not run.over:
                self._state.changed.emit()
            elif not done:
                done = True
                on_end(run)

        run.on_change(look)
        return run

    def context(self, gripper: str) -> HandlingContext:
        """Return what the operations of a gripper share; made when it is first asked for.

        Raises
        ------
        ConfigError
            There is no such gripper, or the platform has not what the settings name.
        """
        if gripper not in self.grippers:
            raise ConfigError(f"there is no gripper {gripper!r}")
        with self._state.lock:
            if gripper not in self._state.contexts:
                other = next((each for each in self.grippers if each != gripper), "")
                # A person pointed at a fibre: the table turns for that one alone.
                grasp = self._settings.grasp.model_copy(update={"views": 1})
                settings = self._settings.model_copy(
                    update={"gripper": gripper, "other": other, "grasp": grasp}
                )
                work = HandlingContext.on(self._rig, settings)
                if self._state.contexts:  # fibres are numbered through
                    work.shared = next(iter(self._state.contexts.values())).shared
                self._state.contexts[gripper] = work
            return self._state.contexts[gripper]

    def _procedure(
        self,
        request: OperationRequest,
        work: HandlingContext,
        push: PushToForce,
        closing: CloseGently,
    ) -> Procedure[HandlingContext]:
        operation = request.operation
        if operation is SingleOperation.CLOSE:
            return build_close_gently(closing)
        if operation is SingleOperation.TAKE and request.marked is not None:
            return build_take(work.settings, request.marked)
        if operation is SingleOperation.PUSH:
            return build_push(push)
        if operation is SingleOperation.UNDO:
            return _UNDO[self._state.done[-1]]()
        return _PLAIN[operation]()

    # How it ended

    def _on_end(
        self,
        request: OperationRequest,
        run: ProcedureRun[HandlingContext],
        push: PushToForce,
        closing: CloseGently,
        doubted: bool,
    ) -> None:
        work = run.work
        work.shared.unsuitable = []
        if run.failure is None:
            values, text = outcome(request, work, push, closing)
            if doubted and work.fibre is None:
                text = f"{work.settings.gripper} is empty; where the fibre came off is not known."
            result = OperationResult(request.title, good=True, text=text, values=values)
            self._note_done(request.operation)
        else:
            result = OperationResult(
                request.title,
                good=False,
                text=self._failed(run),
                values=untrusted(work),
                interrupted=interruption(run),
            )
        self._end(result)

    def _failed(self, run: ProcedureRun[HandlingContext]) -> str:
        """Return why a run failed, what is held all the same, and what to do."""
        interrupted = interruption(run)
        text = str(run.failure)
        if interrupted == STOPPED:
            reason = self._rig.mico.stop_state.reason
            text = f"Motion was stopped: {reason}." if reason else "Motion was stopped."
        elif interrupted:
            text = f"It was {text.removeprefix(f'{run.name}: ')}."
        if run.not_safe and interrupted != STOPPED:
            text = f"{text.removesuffix('.')}; not made safe: {run.not_safe}"
        if interrupted and self.held_by:
            text = f"{text} {self.held_by} still holds the fibre."
        advice = " Look at the tools, press Reset, then go on."
        return text + advice if interrupted == STOPPED else text

    def _on_movement(self, news: MovementNews) -> None:
        """See whether the jaws that hold a fibre were opened, by no operation; device threads."""
        fibre, work = self._carried, self._state.contexts.get(self._state.gripper)
        if not isinstance(news, AxisEnded) or fibre is None or work is None or self.running:
            return
        if news.name != work.gripper.gap_axis or news.position is None:
            return
        known = not fibre.doubted
        fibre.note_opening(news.position)
        work.gap_um = fibre.opened_um(news.position)
        if known and fibre.doubted:
            text = (
                f"The jaws of {self._state.gripper} were opened: whether they still hold fibre "
                f"{fibre.number} is not known. Put away opens them over the bin, and looks."
            )
            self._state.done = []
            self._state.result = OperationResult(
                "Jaws opened", good=False, text=text, interrupted=IN_DOUBT
            )
            logger.info("%s", text)
            self._state.changed.emit()

    def _on_replayed(
        self,
        run: ProcedureRun[HandlingContext],
        operations: tuple[SingleOperation, ...],
        values: tuple[tuple[str, str], ...],
    ) -> None:
        if run.failure is None:
            self._state.done = []
            for each in operations:
                self._note_done(each)
            text = "Every step was carried out."
            result = OperationResult(f"Replay {run.name}", good=True, text=text, values=values)
        else:
            result = OperationResult(
                f"Replay {run.name}",
                good=False,
                text=self._failed(run),
                values=values,
                interrupted=interruption(run),
            )
        self._end(result)

    def _end(self, result: OperationResult) -> None:
        if self.fibre is None:
            self._state.done = []
        self._state.result = result
        _forget_moves(self._rig)
        values = ", ".join(f"{name} {value}" for name, value in result.values)
        reported = f"{result.text} {values}".strip()  # the card goes with the next operation
        logger.info("%s: %s", result.title, reported)
        self._state.changed.emit()

    def _note_done(self, operation: SingleOperation) -> None:
        if operation is SingleOperation.CLOSE:
            return
        if operation is SingleOperation.UNDO or (operation in PUSHES and self.last in PUSHES):
            self._state.done.pop()  # several pushes are taken back as one: the probe goes away
        if operation is not SingleOperation.UNDO:
            self._state.done.append(operation)

    def close(self) -> None:
        """Abort what runs, and let go of the force channel; harmless the second time."""
        self._forget_movements()
        run = self._state.run
        if run is not None and self.running:
            run.abort("the platform is closed")
            run.join()
        for work in self._state.contexts.values():
            work.close()


def _nothing() -> None:
    return None


_UNDO: Final[Mapping[SingleOperation, Callable[[], Procedure[HandlingContext]]]] = {
    SingleOperation.TAKE: build_lay_back,
    SingleOperation.BRING: build_carry_back,
    SingleOperation.PUSH: build_retract,
    SingleOperation.MEASURE: build_retract,
}
_PLAIN: Final[Mapping[SingleOperation, Callable[[], Procedure[HandlingContext]]]] = {
    SingleOperation.BRING: build_bring,
    SingleOperation.MEASURE: build_measure,
    SingleOperation.PUT_AWAY: build_put_away,
}


def _forget_moves(rig: Applications) -> None:
    """Have Undo of movements begin anew: what an operation did is taken back by operations.

    One movement of an operation taken back alone could lead the probe into the fibre.
    """
    application = rig.mico.application
    if isinstance(application, MicoApplication):
        application.undo.forget_all()
