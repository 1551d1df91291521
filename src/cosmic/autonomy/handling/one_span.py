"""One push of one span: the probe finds the fibre, bends it, lets it go, and keeps what it read."""

import logging
import math
from collections.abc import Generator
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from cosmic.autonomy.bending.bent_shape import BentShape
from cosmic.autonomy.bending.plan import PlannedSpan
from cosmic.autonomy.bending.span import Freed, Span
from cosmic.autonomy.handling.bent_image import FibreSeen, HeldLine
from cosmic.autonomy.handling.careful_move import CarefulMove
from cosmic.autonomy.handling.context import HandlingContext
from cosmic.autonomy.handling.force import ForceMean
from cosmic.autonomy.handling.force_limit import check_watched
from cosmic.autonomy.handling.grasp import shape_of
from cosmic.autonomy.handling.held_fibre import HeldFibre
from cosmic.autonomy.handling.retrying_move import RetryingMove
from cosmic.autonomy.handling.settings import PushSettings
from cosmic.autonomy.handling.surface import Contact, foresee_off
from cosmic.autonomy.procedures.operation import OperationFailed, Steps, Yielded
from cosmic.frame.errors import DeviceError, NotAvailable
from cosmic.vico.core.image import CameraImage

logger = logging.getLogger(__name__)

NO_CONTACT: Final = "no contact"
TOO_HIGH: Final = "force too high"
OBSTRUCTED: Final = "probe in contact"
UN_UM2: Final = 1e18
LIMIT_PART: Final = 0.4
"""Of the force limit: what one step of the search may add at most."""
GUESS_TIMES: Final = 1.6
"""So much stiffer than guessed a fibre may be at a span."""
SURE_TIMES: Final = 2.0
"""The probe comes near a fibre at once but for so many standard deviations of where that is."""
SURER_TIMES: Final = 8.0
"""From so many on it goes so slowly that it stops in time however stiff the fibre is there."""
SLOWEST_HZ: Final = 10
SLOW_UM: Final = 100.0
"""How far before where it goes to the probe becomes slow: it may come from far away."""
MET_STD_UM: Final = 0.7
"""Of the contact that the rise of a push leads back to."""
LOST_PART: Final = 0.1
"""Of the force before: what is less has left the probe."""
CLEAR_UM: Final = 3.0
"""So far back a fibre does not cling to the probe."""
FINE_UM: Final = 1.5
PRESS_PART: Final = 0.75
"""Of how far it is to be pressed: what one step adds at most."""
PRESSES: Final = 8
TINY_UN: Final = 0.01
SLIDE_TIMES: Final = 2.0
"""So many times as far as it is pressed a fibre is slid at least: half of friction times how much
more a ribbon gives way in its other plane."""
SLIDE_WELL_TIMES: Final = 4.0
"""The same where there is a choice: farther pressed, the force tells more than the stages creep."""
SLIDE_PART: Final = 0.5
"""Of the push, and of the highest force: a fibre is pressed by no more to be slid, for friction
bends it up or down beside."""
DEEP_PART: Final = 0.5
"""Of a push: where the last step of the search may have led so far into it, it is begun again from
without contact, or too few readings would be left to tell how stiff the fibre is."""
COARSE_PART: Final = 0.25
"""Of a push: its steps where the fibre should have been felt already."""
CLOSE_PART: Final = 0.2
"""Of how far it is to be pressed: near enough."""
GROWTH: Final = 1.5
"""How much more than the step before one step may add, when the next is foreseen."""
CEILING_TIMES: Final = 1.15
LEAST_BACK: Final = 5
"""Readings of the way back until where the fibre was met."""
LEAST_FREE: Final = 2


@dataclass(slots=True)
class _Points:
    """What was measured on the way of one span."""

    probe_um: list[float] = field(default_factory=list)
    force_un: list[float] = field(default_factory=list)
    std_un: list[float] = field(default_factory=list)
    time_s: list[float] = field(default_factory=list)
    loading: list[bool] = field(default_factory=list)

    def add(self, probe_um: float, mean: ForceMean, *, loading: bool) -> None:
        self.probe_um.append(probe_um)
        self.force_un.append(mean.mean_un)
        self.std_un.append(max(mean.std_un, 1e-3))
        self.time_s.append(mean.time_s)
        self.loading.append(loading)

    def keep_first(self) -> None:
        """Forget all but the first."""
        for each in (self.probe_um, self.force_un, self.std_un, self.time_s, self.loading):
            del each[1:]


Reading = Generator[Yielded, object, tuple[float, ForceMean]]


class OneSpan:
    """One push, out and back, at one place."""

    def __init__(self, work: HandlingContext, fibre: HeldFibre, plan: PlannedSpan) -> None:
        self._work = work
        self._fibre = fibre
        self._plan = plan
        self._push = work.settings.push
        self._probe = work.probe
        self._points = _Points()
        self._freed: Freed | None = None
        self._unpushed: FibreSeen | None = None
        self._bent: BentShape | None = None
        self._shape = shape_of(work, fibre)
        self._slope = self._shape.slope_at(plan.span_um)
        self._first = fibre.zero_un is None
        # Where the camera has shown it in the jaws; a standard is too thin for its pixels.
        shown = "held" in fibre.images and not fibre.standard
        self._witnessed = self._push.witness and shown and not fibre.spans
        # The probe pushes along its own direction; way grows as it does.
        self._sign = 1.0 if work.probe.forward[1] > 0.0 else -1.0
        self._line = HeldLine(work, self._shape, plan.span_um, fibre.width_um, self._sign)

    def steps(self) -> Steps:
        """Find the fibre, push it, let it go, and keep the span.

        Raises
        ------
        OperationFailed
            It was not met, or more was felt than a push may; the probe is back from it then.
        """
        try:
            yield from self._go_in_front()
            base = yield from self._baseline()
            if self._witnessed:
                self._unpushed = yield from self._look(0.0)
            contact = yield from self._search(base)
            if self._first and self._push.rest_s > 0.0:
                yield from self._rest(contact)
            yield from self._slide(base, contact)
            yield from self._out(base, contact)
            self._place_contact(contact)
            yield from self._dwell()
            yield from self._see_bent(base, contact)
            yield from self._back(contact)
        except OperationFailed as failure:
            if failure.cause == TOO_HIGH:
                yield from self._withdraw()
            raise
        self._keep()

    def _to_probe(self, tip_y_um: float) -> float:
        return self._sign * tip_y_um

    def _to_travel(self, probe_um: float) -> RetryingMove:
        return self._work.go({self._probe.y_axis: self._sign * probe_um - self._probe.tip_um[1]})

    def _advance(self, probe_um: float) -> Steps:
        """Go there; more force than any push should reach ends it, before the limit would."""
        most = ceiling_un(self._push)
        move = yield self._careful(probe_um, -most, most)
        if isinstance(move, CarefulMove) and move.felt_un is not None:
            raise OperationFailed(
                TOO_HIGH,
                f"{move.felt_un:.0f} uN on the path of the probe, {self._plan.span_um:.0f} um from "
                f"the jaws; more than {most:.0f} uN ends a push",
            )

    def _careful(
        self, probe_um: float, low_un: float, high_un: float
    ) -> RetryingMove | CarefulMove:
        """Return a movement there that a force ends; nothing ends one that leads back."""
        _, y = self._work.tip_now(self._probe)
        move = self._to_travel(probe_um)
        if probe_um <= self._to_probe(y):
            return move
        check_watched(self._work)
        return CarefulMove(move, self._work.forces, low_un, high_un)

    def _withdraw(self) -> Steps:
        _, y = self._work.tip_now(self._probe)
        yield self._to_travel(self._to_probe(y) - self._push.stand_off_um - self._push.search_um)

    def _surface_um(self) -> tuple[float, float]:
        """Return the way at which the probe should meet the fibre, and how sure that is."""
        off, std = foresee_off(self._fibre.contacts, self._plan.span_um, self._slope)
        return self._foreseen_um() + off, std

    def _foreseen_um(self) -> float:
        _, hold_y = self._work.tip_now(self._work.gripper)
        _, off_y = self._work.calibration.probe_off_um
        bow = self._shape.bow_um(self._plan.span_um)
        return self._to_probe(hold_y + bow - off_y) - self._fibre.width_um / 2.0

    def _go_in_front(self) -> Steps:
        work, push = self._work, self._push
        hold_x, _ = work.tip_now(work.gripper)
        off_x, _ = work.calibration.probe_off_um
        x = hold_x + work.jaws.forward * self._plan.span_um - off_x
        surface, std = self._surface_um()
        bow = abs(self._shape.bow_um(self._plan.span_um))
        aside = surface - push.stand_off_um - push.bow_part * bow
        _, y = work.tip_now(self._probe)
        if self._to_probe(y) > aside:
            yield self._to_travel(aside)
        if self._first:
            self._fibre.zero_un = yield from self._mean_un(push.average_s)
        yield work.go({self._probe.x_axis: x - self._probe.tip_um[0]})
        if self._fibre.tilts:
            part = self._plan.span_um / push.tilt_longest_um
            side = -1.0 if self._fibre.tilts % 2 else 1.0
            yield work.go_up(work.hold_tip_um + side * push.tilt_um * part)
        # Only where the fibre was met before is it known well enough to come nearer at once.
        near = surface - push.near_um
        if self._fibre.contacts:
            yield from self._come_to(near - SURE_TIMES * std, near - SURER_TIMES * std)
        else:
            yield from self._come_to(aside, aside)

    def _come_to(self, probe_um: float, sure_um: float) -> Steps:
        """Go there, and back again as long as something is felt that should not be there.

        The probe goes slowly, and no further where it feels something: nothing is known to be
        there, and a short span is stiff. Beyond `sure_um` it goes as slowly as that asks for.
        """
        work, push, back = self._work, self._push, 0.0
        zero = self._fibre.zero_un or 0.0
        _, y = work.tip_now(self._probe)
        if self._to_probe(y) < probe_um - SLOW_UM:
            yield self._to_travel(probe_um - SLOW_UM)
        while True:
            yield from self._feel_along(probe_um - back, sure_um, zero)
            force = yield from self._mean_un(push.search_average_s)
            if abs(force - zero) <= 2.0 * push.contact_un:
                return
            back += push.stand_off_um
            if back > push.search_um + push.stand_off_um:
                raise OperationFailed(
                    OBSTRUCTED, f"the probe feels {force:.0f} uN where nothing should be"
                )

    def _feel_along(self, to_um: float, sure_um: float, zero_un: float) -> Steps:
        """Go there slowly, and no further where something is felt."""
        work, push = self._work, self._push
        low, high = zero_un - push.surprise_un, zero_un + push.surprise_un
        axis, fast_hz = work.mico[self._probe.y_axis], work.settings.frequency_hz
        slow_hz = min(push.slow_hz, fast_hz)
        _, y = work.tip_now(self._probe)
        try:
            if self._to_probe(y) < sure_um < to_um:
                axis.set_closed_loop_frequency(slow_hz)
                move = yield self._careful(sure_um, low, high)
                if isinstance(move, CarefulMove) and move.felt_un is not None:
                    return
            hertz = min(slow_hz, self._stopping_hz()) if to_um > sure_um else slow_hz
            axis.set_closed_loop_frequency(hertz)
            yield self._careful(to_um, low, high)
        finally:
            axis.set_closed_loop_frequency(fast_hz)

    def _mean_un(self, seconds: float) -> Generator[Yielded, object, float]:
        mean = yield self._work.forces.wanted(seconds, settle_s=self._push.settle_s)
        assert isinstance(mean, ForceMean)
        return mean.mean_un

    def _measure(self, seconds: float, *, loading: bool) -> Reading:
        mean = yield self._work.forces.wanted(seconds, settle_s=self._push.settle_s)
        assert isinstance(mean, ForceMean)
        _, y = self._work.tip_now(self._probe)
        self._points.add(self._to_probe(y), mean, loading=loading)
        return self._to_probe(y), mean

    def _baseline(self) -> Generator[Yielded, object, float]:
        _, mean = yield from self._measure(self._push.average_s, loading=True)
        self._fibre.zero_un = mean.mean_un
        return mean.mean_un

    def _to(self, probe_um: float, seconds: float, *, loading: bool) -> Reading:
        yield from self._advance(probe_um)
        return (yield from self._measure(seconds, loading=loading))

    def _stiffest_un_um(self) -> float:
        """Return how stiff the fibre may be here, uN/um."""
        ei = self._push.stiffest_ei_n_m2
        if self._fibre.ei_guess_n_m2 is not None:
            ei = min(ei, GUESS_TIMES * self._fibre.ei_guess_n_m2)
        return 3.0 * ei * UN_UM2 / self._plan.span_um**3

    def _step_um(self) -> float:
        """Return the largest step at which even the stiffest fibre pushes back little enough."""
        push = self._push
        return min(push.search_step_um, LIMIT_PART * push.limit_un / self._stiffest_un_um())

    def _stopping_hz(self) -> int:
        """Return how fast the probe may go to be stopped before the force is too high."""
        push = self._push
        reach_um = push.limit_un / self._stiffest_un_um()
        return max(math.floor(reach_um / (push.reaction_s * push.stride_um)), SLOWEST_HZ)

    def _search(self, base_un: float) -> Generator[Yielded, object, float]:
        push, step = self._push, self._step_um()
        travel = self._points.probe_um[-1]
        end = self._surface_um()[0] + push.search_um
        while travel < end:
            before = travel
            travel, mean = yield from self._to(travel + step, push.search_average_s, loading=True)
            if mean.mean_un - base_un > push.contact_un:
                self._note_contact(0.5 * (before + travel), 0.5 * (travel - before))
                return before
        raise OperationFailed(
            NO_CONTACT,
            f"the probe met nothing {push.search_um:g} um beyond where fibre "
            f"{self._fibre.number} should be, {self._plan.span_um:.0f} um from the jaws",
        )

    def _rest(self, free_um: float) -> Steps:
        """Wait where nothing was felt, for stages creep on after a long way.

        They did so while the fibre was looked for; what was read meanwhile does not count.
        """
        push, points = self._push, self._points
        _, mean = yield from self._to(free_um - CLEAR_UM, push.search_average_s, loading=True)
        rested_s = mean.time_s - points.time_s[0]
        if rested_s < push.rest_s:
            yield push.rest_s - rested_s
        points.keep_first()
        yield from self._measure(push.average_s, loading=True)

    def _note_contact(self, probe_um: float, std_um: float) -> None:
        off = probe_um - self._foreseen_um()
        self._fibre.contacts.append(Contact(self._plan.span_um, off, std_um, self._slope))

    def _place_contact(self, free_um: float) -> None:
        """Put right where the fibre was met: the rise of the force tells better than a step."""
        self._fibre.contacts.pop()
        self._note_contact(self._met_um(free_um), MET_STD_UM)

    def _slide(self, base_un: float, free_um: float) -> Steps:
        """Slide the fibre up and down the probe as it is pressed a little, and leave it again.

        Friction holds a section that stands askew, and makes it too stiff; what the force is once
        that was made to let go tells by how much. The fibre comes back to where it was each time.
        """
        push, fibre = self._push, self._fibre
        wanted = push.slide_um > 0.0 and not (fibre.standard or fibre.slid_off)
        if not wanted or len(fibre.spans) % push.slide_every:
            if self._points.probe_um[-1] - free_um > DEEP_PART * self._plan.stroke_um:
                yield from self._to(free_um - CLEAR_UM, push.search_average_s, loading=True)
            return
        # Begun from without contact, as the push is.
        clear_um = free_um - CLEAR_UM
        yield from self._to(clear_um, push.search_average_s, loading=True)
        before = yield from self._press(base_un, free_um)
        if before is not None:
            after = len(self._points.probe_um) - 1
            forces = yield from self._slid()
            least = base_un + LOST_PART * (before.mean_un - base_un)
            fibre.slid_off = min(each.mean_un for each in forces) < least
            if not fibre.slid_off:
                self._freed = Freed(
                    after=after,
                    up_un=np.array([each.mean_un for each in forces[::2]]),
                    down_un=np.array([each.mean_un for each in forces[1::2]]),
                    std_un=max(float(np.mean([each.std_un for each in forces])), 1e-3),
                    wait_s=0.5 * (forces[-1].time_s - before.time_s),
                )
        yield from self._to(clear_um, push.search_average_s, loading=True)

    def _slid(self) -> Generator[Yielded, object, list[ForceMean]]:
        """Go up and back, then down and back, and read the force after each."""
        work, push, height = self._work, self._push, self._work.height_now()
        forces: list[ForceMean] = []
        for side in (push.slide_um, -push.slide_um):
            yield work.go_up(height + side)
            yield work.go_up(height)
            mean = yield work.forces.wanted(push.average_s, settle_s=push.settle_s)
            assert isinstance(mean, ForceMean)
            forces.append(mean)
        return forces

    def _press(
        self, base_un: float, free_um: float
    ) -> Generator[Yielded, object, ForceMean | None]:
        """Push until the force tells much; None: so far that no slide would make it let go."""
        push, probe_um, before = self._push, free_um, 0.0
        wanted_um = min(push.slide_um / SLIDE_WELL_TIMES, SLIDE_PART * self._plan.stroke_um)
        step = min(self._step_um(), FINE_UM, PRESS_PART * wanted_um)
        for _ in range(PRESSES):
            probe_um, mean = yield from self._to(probe_um + step, push.average_s, loading=True)
            force = mean.mean_un - base_un
            if force >= push.slide_un:
                rise = max(force - before, TINY_UN)
                # It was met somewhere within a step that begins free of it.
                pressed = step * (force / rise if before > push.contact_un else 0.5)
                left_um = wanted_um - pressed
                if left_um <= CLOSE_PART * wanted_um or (
                    force + GROWTH * rise > SLIDE_PART * push.limit_un
                ):
                    return mean if pressed <= push.slide_um / SLIDE_TIMES else None
                step = min(step, left_um)
            before = max(force, 0.0)
        return None

    def _out(self, base_un: float, contact_um: float) -> Steps:
        push, points = self._push, self._points
        step = self._plan.stroke_um / push.steps_out
        top = contact_um + self._plan.stroke_um
        if points.probe_um[-1] < contact_um - step:  # after sliding; nothing was met up to there
            yield from self._to(contact_um, push.average_s, loading=True)
        while points.probe_um[-1] < top - 0.5 * step:
            force, before = points.force_un[-1] - base_un, points.force_un[-2] - base_un
            slope = max(0.0, (force - before) / max(points.probe_um[-1] - points.probe_um[-2], 0.5))
            if force + GROWTH * slope * step > push.limit_un:
                break
            yield from self._to(
                points.probe_um[-1] + min(step, self._step_um()), push.average_s, loading=True
            )
            if points.force_un[-1] - base_un > push.contact_un:
                step = self._plan.stroke_um / push.steps_out
            elif (farther := self._farther_um(contact_um)) > top:
                top, step = farther, COARSE_PART * self._plan.stroke_um
        if points.force_un[-1] - base_un > push.limit_un * GROWTH:
            raise OperationFailed(TOO_HIGH, f"{points.force_un[-1] - base_un:.0f} uN")

    def _farther_um(self, contact_um: float) -> float:
        """Return where a push ends whose fibre is not felt yet.

        It was met somewhere within a step of the search, which may be longer than the whole push.
        """
        stroke = self._plan.stroke_um
        late = min(self._points.probe_um[-1], contact_um + self._push.search_step_um) - contact_um
        return contact_um + stroke + (late if late > 0.5 * stroke else 0.0)

    def _dwell(self) -> Steps:
        """Read the force at the farthest point for a while: the fibre may relax."""
        push = self._push
        for _ in range(push.dwell_looks):
            yield push.dwell_s / push.dwell_looks
            yield from self._measure(push.average_s, loading=True)

    def _look(self, pushed_um: float) -> Generator[Yielded, object, FibreSeen | None]:
        """Return where an image shows the fibre; None where there is none to be had."""
        work = self._work
        try:
            if work.vico.camera(work.settings.camera).problem:
                return None  # nobody waits for a witness while the fibre is bent
            image = yield work.image()
            assert isinstance(image, CameraImage)
            return self._line.seen(image, pushed_um)
        except (NotAvailable, DeviceError) as exc:
            logger.warning("the bent shape is not looked at: %s", exc)
            return None

    def _see_bent(self, base_un: float, contact_um: float) -> Steps:
        """Keep how an image shows the fibre bent at the farthest point: a second witness."""
        if self._unpushed is None:
            return
        points = self._points
        probe_um, force_un = points.probe_um[-1], points.force_un[-1] - base_un
        after = yield from self._look(probe_um - self._met_um(contact_um))
        if after is not None:
            self._bent = self._line.bent(
                self._unpushed, after, probe_um=probe_um, force_un=force_un
            )

    def _back(self, contact_um: float) -> Steps:
        push = self._push
        top, end = self._points.probe_um[-1], contact_um - push.retreat_um / 2.0
        for travel in places_back_um(top, self._met_um(contact_um), end, push.steps_back):
            yield from self._to(travel, push.average_s, loading=False)
        yield from self._to(contact_um - push.retreat_um, push.average_s, loading=False)

    def _met_um(self, free_um: float) -> float:
        """Return about where the fibre was met, beyond where the probe was still free of it."""
        base, paths = self._fibre.zero_un or 0.0, np.array(self._points.probe_um)
        forces = np.array(self._points.force_un) - base
        first = int(np.argmax(paths > free_um))
        rise = float(forces[-1] - forces[first])
        if rise <= 0.0:
            return free_um
        met = paths[first] - forces[first] * (paths[-1] - paths[first]) / rise
        return float(min(max(met, free_um), paths[first]))

    def _keep(self) -> None:
        work, points = self._work, self._points
        probe_x, _ = work.tip_now(self._probe)
        hold_x, _ = work.tip_now(work.gripper)
        off_x, _ = work.calibration.probe_off_um
        ahead = (probe_x + off_x - hold_x) * work.jaws.forward
        shape = self._shape.natural(ahead, -self._sign)
        longer = shape.lever_um() - ahead
        self._fibre.spans.append(
            Span(
                nominal_um=ahead + longer,
                probe_x_um=probe_x - self._probe.tip_um[0] + longer * work.jaws.forward,
                hold_x_um=hold_x - work.gripper.tip_um[0],
                probe_um=np.array(points.probe_um),
                force_un=np.array(points.force_un),
                force_std_un=np.array(points.std_un),
                time_s=np.array(points.time_s),
                loading=np.array(points.loading, dtype=np.bool_),
                shape=shape,
                freed=self._freed,
                bent=self._bent,
            )
        )


def ceiling_un(push: PushSettings) -> float:
    """Return the force that ends a push: between what it may reach and what stops everything."""
    if push.stop_un > push.limit_un:
        return 0.5 * (push.limit_un + push.stop_un)
    return CEILING_TIMES * push.limit_un


def places_back_um(top_um: float, met_um: float, end_um: float, steps: int) -> list[float]:
    """Return where the force is read on the way back: evenly, but enough of it on the fibre.

    A stiff or short span is pushed by a micrometre or two. In steps laid out over the whole way
    the fibre would be left within one of them, and nothing would be known of the way back.
    """
    pressed = max(round(steps * (top_um - met_um) / (top_um - end_um)), LEAST_BACK)
    free = max(steps - pressed, LEAST_FREE)
    on_it = np.linspace(top_um, met_um, pressed + 1)[1:]
    return [*on_it.tolist(), *np.linspace(met_um, end_um, free + 1)[1:].tolist()]
