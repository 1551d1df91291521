"""What only single operations need: lift, push to a force, put back where it came from."""

import math
from collections.abc import Generator
from dataclasses import dataclass
from typing import Final

from typing_extensions import override

from cosmic.autonomy.bending.fit import measure_fibre
from cosmic.autonomy.bending.plan import DRY_EI_N_M2, PlannedSpan
from cosmic.autonomy.bending.result import UN_UM2_PER_N_M2, SpanFit
from cosmic.autonomy.bending.span import Span
from cosmic.autonomy.handling.approach import STAND_BACK_UM, line_of
from cosmic.autonomy.handling.context import FibreOperation, HandlingContext
from cosmic.autonomy.handling.force import ForceMean
from cosmic.autonomy.handling.force_limit import arm_force_limit, put_back
from cosmic.autonomy.handling.grasp import in_jaws, seen_at, shape_of
from cosmic.autonomy.handling.held_fibre import HeldFibre
from cosmic.autonomy.handling.jaws import move_jaws, note_closed, note_gap, open_jaws
from cosmic.autonomy.handling.one_span import OneSpan
from cosmic.autonomy.handling.plate import along
from cosmic.autonomy.handling.prepare import retract_probe, zoom_to
from cosmic.autonomy.handling.push import (
    fit_settings,
    ready_force,
    span_limits,
)
from cosmic.autonomy.handling.put_away import ADHESION
from cosmic.autonomy.procedures.operation import SAFE_POINT, OperationFailed, Steps, Yielded
from cosmic.vico.core.image import CameraImage

NOT_HELD: Final = "no fibre held"
NOT_THERE: Final = "not at the probe"
YIELDS: Final = "gives way"
TOO_SHORT: Final = "too short"
NEAR_UM: Final = 100.0
"""How far a gripper may be from where it holds a fibre before the probe."""
BEND_PART: Final = 0.05
"""Of the span: how far a fibre should bend at the force wanted; the span is chosen by it."""
MOST_BEND_PART: Final = 0.2
"""How far it may bend before the push is given up."""
GENTLE_UM: Final = 5.0
GENTLE_HZ: Final = 200.0
"""How far the jaws close between two looks at the force, and how fast their steps come."""
HELD_STD_UM: Final = 25.0
"""How well closed jaws are known to be closed: a fibre may be between."""
GENTLE_TIMES: Final = 3.0
"""Of the force that means contact: what ends a gentle closing."""
NEAR_PART: Final = 0.02
"""How near the force wanted is near enough."""


class LookReady(FibreOperation):
    """The lens stands as images of fibres are taken, whatever was done by hand meanwhile."""

    name = "set the zoom"

    @override
    def steps(self, work: HandlingContext) -> Steps:
        work.shared.zoomed = None
        yield from zoom_to(work, work.settings.zoom)
        yield SAFE_POINT


class Held(FibreOperation):
    """A fibre is held; else nothing begins."""

    name = "a fibre is held"

    @override
    def steps(self, work: HandlingContext) -> Steps:
        if work.fibre is None or not work.fibre.held:
            raise OperationFailed(NOT_HELD, f"{work.settings.gripper} holds no fibre; take one")
        yield SAFE_POINT


class AtProbe(FibreOperation):
    """The held fibre is before the probe, where it is put exactly; else nothing begins."""

    name = "the fibre is before the probe"

    @override
    def steps(self, work: HandlingContext) -> Steps:
        if not is_at_probe(work):
            raise OperationFailed(
                NOT_THERE, "the fibre is not before the probe; bring it to the probe first"
            )
        positions = work.settings.places
        x = positions.hold_x_um * work.jaws.forward
        yield work.go(work.at(work.gripper, x, positions.hold_y_um, work.hold_tip_um))
        yield SAFE_POINT


def is_at_probe(work: HandlingContext) -> bool:
    """Return whether the gripper stands where fibres are held before the probe."""
    positions = work.settings.places
    x, y = work.tip_now(work.gripper)
    aside = math.hypot(x - positions.hold_x_um * work.jaws.forward, y - positions.hold_y_um)
    return max(aside, abs(work.height_now() - work.hold_tip_um)) <= NEAR_UM


class LiftUp(FibreOperation):
    """The fibre is lifted to the height at which grippers travel."""

    name = "lift up"

    @override
    def steps(self, work: HandlingContext) -> Steps:
        yield work.rise(work.settings.places.travel_um)
        yield SAFE_POINT


@dataclass(frozen=True, slots=True, eq=False)
class PushedTo:
    """What one push to a force has shown.

    Attributes
    ----------
    force_un, force_std_un : float
        At the farthest point, above the baseline, with the noise of its mean.
    bend_um : float
        How far the probe went beyond the first contact.
    fit : SpanFit
        The stiffness at that span.
    """

    force_un: float
    force_std_un: float
    bend_um: float
    span_um: float
    fit: SpanFit


class PushToForce(FibreOperation):
    """The probe pushes the held fibre until it pushes back with a force, and lets it go.

    Parameters
    ----------
    force_un : float
        The force wanted, above the baseline.
    """

    def __init__(self, force_un: float) -> None:
        self.force_un = force_un
        self.name = f"push to {force_un:g} uN"
        self.pushed: PushedTo | None = None

    @override
    def precondition(self, work: HandlingContext) -> None:
        most = work.settings.push.limit_un
        if not 0.0 < self.force_un <= most:
            raise OperationFailed(
                "force out of range", f"{self.force_un:g} uN is not between 0 and {most:g} uN"
            )

    @override
    def steps(self, work: HandlingContext) -> Steps:
        fibre = work.held_fibre()
        plan = _plan(work, fibre, self.force_un)
        yield from ready_force(work)
        before = arm_force_limit(work)
        try:
            push = _PushTo(work, fibre, plan)
            yield from push.steps()
        finally:
            put_back(work, before)
            fibre.peak_un = max(fibre.peak_un, work.forces.take_peak_un())
        self.pushed = push.result(work, fibre)


def _plan(work: HandlingContext, fibre: HeldFibre, force_un: float) -> PlannedSpan:
    """Return where to push: at the span where the fibre should bend by a small part of it."""
    limits = span_limits(work)
    gentle = shape_of(work, fibre).gentle_um(work.settings.push.steepest_deg)
    room = min(limits.longest_um, min(fibre.free_um, gentle) - limits.beyond_um)
    if not room >= limits.shortest_um:
        raise OperationFailed(TOO_SHORT, f"only {room:.0f} um of the fibre can be pushed")
    ei = (fibre.ei_guess_n_m2 or DRY_EI_N_M2) * UN_UM2_PER_N_M2
    span = min(max(math.sqrt(3.0 * ei * BEND_PART / force_un), limits.shortest_um), room)
    return PlannedSpan(span_um=span, stroke_um=MOST_BEND_PART * span, force_un=force_un)


class _PushTo(OneSpan):
    """One push that ends at a force."""

    def __init__(self, work: HandlingContext, fibre: HeldFibre, plan: PlannedSpan) -> None:
        super().__init__(work, fibre, plan)
        self._top: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @override
    def _out(self, base_un: float, contact_um: float) -> Steps:
        points, wanted = self._points, self._plan.force_un
        while True:
            force = points.force_un[-1] - base_un
            bend = points.probe_um[-1] - contact_um
            self._top = force, points.std_un[-1], bend
            if force >= wanted * (1.0 - NEAR_PART):
                return
            if bend >= self._plan.stroke_um:
                raise OperationFailed(
                    YIELDS,
                    f"the fibre gives way: {force:.0f} uN after {bend:.0f} um, "
                    f"{self._plan.span_um:.0f} um from the jaws",
                )
            yield from self._to(
                points.probe_um[-1] + self._next_um(wanted - force),
                self._push.average_s,
                loading=True,
            )

    def _next_um(self, missing_un: float) -> float:
        """Return a step that leads to the force wanted, and not beyond it."""
        probe, force = self._points.probe_um, self._points.force_un
        slope = (force[-1] - force[-2]) / max(probe[-1] - probe[-2], 0.2)
        step = self._step_um()
        return max(0.2, min(step, missing_un / slope) if slope > 0.0 else step)

    def result(self, work: HandlingContext, fibre: HeldFibre) -> PushedTo:
        """Return what it has shown; the span it left with the fibre is taken back."""
        span: Span = fibre.spans.pop()
        measured = measure_fibre([span], settings=fit_settings(work, fibre))
        force, std, bend = self._top
        return PushedTo(force, std, bend, span.nominal_um, measured.spans[0])


class StandOff(FibreOperation):
    """The probe goes back from the fibre as far as it stands off before a push."""

    name = "take the probe back"

    @override
    def steps(self, work: HandlingContext) -> Steps:
        push = work.settings.push
        x, y = work.tip_now(work.probe)
        back = push.stand_off_um + push.search_um
        yield work.go(work.at(work.probe, x, y - back * (1.0 if work.probe.forward[1] > 0 else -1)))


class CloseGently(FibreOperation):
    """The jaws close slowly, a little at a time, until something is felt or they are closed.

    What they hold is not felt by themselves: the force is that of the probe's sensor, where a fibre
    touches it. Without any, the number of steps is the limit.
    """

    name = "close gently"

    def __init__(self) -> None:
        self.closed_um = 0.0
        self.felt_un: float | None = None

    @override
    def steps(self, work: HandlingContext) -> Steps:
        axis = work.mico[work.gripper.gap_axis]
        opening_um = axis.position_um
        if opening_um is None:
            raise OperationFailed(
                "opening unknown", f"{axis.key}: its opening is unknown; initialise the platform"
            )
        base_un = yield from self._force_un(work)
        most_um = opening_um + work.settings.grasp.closing_um
        while self.closed_um < most_um:
            yield from move_jaws(work, -GENTLE_UM, frequency_hz=GENTLE_HZ)
            self.closed_um += GENTLE_UM
            force_un = yield from self._force_un(work)
            if base_un is None or force_un is None:
                continue
            if abs(force_un - base_un) > GENTLE_TIMES * work.settings.push.contact_un:
                self.felt_un = force_un - base_un
                note_closed(work)
                return
        note_gap(work, 0.0, HELD_STD_UM)
        note_closed(work)

    @staticmethod
    def _force_un(work: HandlingContext) -> Generator[Yielded, object, float | None]:
        if not work.forces.running:
            return None
        mean = yield work.forces.wanted(work.settings.push.search_average_s)
        return mean.mean_un if isinstance(mean, ForceMean) else None


class CarryBack(FibreOperation):
    """The held fibre is carried back over the place it was taken from."""

    name = "carry back"

    @override
    def steps(self, work: HandlingContext) -> Steps:
        fibre = work.held_fibre()
        yield from retract_probe(work)
        yield work.rise(work.settings.places.travel_um)
        x, y = _taken_at(fibre)
        yield work.go(work.at(work.gripper, x - STAND_BACK_UM * work.jaws.forward, y))


class LayBack(FibreOperation):
    """The held fibre is laid where it was taken from, and the jaws leave it."""

    name = "lay it back"

    @override
    def steps(self, work: HandlingContext) -> Steps:
        fibre, positions = work.held_fibre(), work.settings.places
        yield from retract_probe(work)
        yield work.rise(positions.travel_um)
        x, y = _taken_at(fibre)
        yield work.go({work.table: fibre.reach.angle_deg} | work.at(work.gripper, x, y))
        with work.mico.collision.contact("grasp"):
            yield work.go_up(work.grasp_um)
        yield from open_jaws(work)
        with work.mico.collision.contact("grasp"):
            yield work.go_up(positions.travel_um)
        yield work.go(work.at(work.gripper, x - STAND_BACK_UM * work.jaws.forward, y))

    @override
    def verify(self, work: HandlingContext) -> Steps:
        fibre = work.held_fibre()
        image = yield work.image()
        assert isinstance(image, CameraImage)
        if seen_at(work, fibre, image, in_jaws(work, fibre), work.height_now()):
            raise OperationFailed(ADHESION, f"fibre {fibre.number} still sticks to the jaws")
        fibre.held, work.fibre = False, None
        work.shared.surveyed = False


def _taken_at(fibre: HeldFibre) -> tuple[float, float]:
    x, y = along(line_of(fibre), fibre.inside_um).tolist()
    return x, y
