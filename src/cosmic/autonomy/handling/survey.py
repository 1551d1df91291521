"""Operations that look at the whole sample and choose a fibre."""

import logging
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from typing_extensions import override

from cosmic.autonomy.handling.context import FibreOperation, HandlingContext
from cosmic.autonomy.handling.held_fibre import HeldFibre
from cosmic.autonomy.handling.plate import Candidate, Neighbours, Reach, reaches, within_um
from cosmic.autonomy.handling.prepare import clear_image
from cosmic.autonomy.handling.settings import GraspSettings, StandardSettings
from cosmic.autonomy.handling.sight import SeenFibre, find_seen
from cosmic.autonomy.procedures.operation import SAFE_POINT, OperationFailed, Steps
from cosmic.frame.arrays import Floats
from cosmic.frame.errors import MoveRefused, StoppedError
from cosmic.vico.core.image import CameraImage

logger = logging.getLogger(__name__)

CROSSING = "crossing"
NOT_CERTAIN = "not certain"
TOO_FAINT = "too faint"
TOO_SHORT = "too short"
TOO_LONG = "too long"
TOO_CURLED = "too curled"
TOO_NEAR = "too near to another"
OUT_OF_FIELD = "out of the field"
SKIPPED = "skipped before"
MEASURED = "measured before"
OUT_OF_REACH = "out of reach"
NONE_LEFT = "no fibre"
LOOK_AGAIN = "look again"
SAME_UM = 120.0
SAME_LENGTH = 0.05
OWN_UM = 1.0
STANDARD_LENGTH = 0.03
STANDARD_CURL = 0.01
DROPPED_LENGTH = 0.004
DROPPED_WIDTH = 0.15
DROPPED_CURL = 0.006
PART_UNLIKE = 0.9
WHOLE_OR_NOT = ("weak signs", "another piece begins", "less sharp", "goes on beyond")
"""Words of doubts that what is seen is the whole fibre: it can be held and bent all the same."""
VIEW_DEG = 70.0
ANOTHER_VIEW = frozenset({NOT_CERTAIN, OUT_OF_FIELD})
"""Problems that an image of the plate at another angle may not have."""
LYING_TOGETHER = frozenset({CROSSING, TOO_NEAR})
"""Problems that stay: where one image does not show the other fibre, it lies there all the same."""


class Survey(FibreOperation):
    """A wide image, and what lies on it; only when it is due.

    Where nothing on it can be taken the plate is turned, and looked at again.
    """

    name = "survey"

    @override
    def steps(self, work: HandlingContext) -> Steps:
        due = work.settings.re_survey and work.shared.since_survey >= work.settings.re_survey
        if work.shared.surveyed and work.shared.candidates and not due:
            return
        yield from clear_image(work)
        before, together = work.shared.lines_um, list[Candidate]()
        yield from self._look(work, before)
        reasons = Counter(work.shared.skip_reasons)
        for angle in views_deg(work.table_deg, work.settings.grasp):
            if can_be_taken(work) or ANOTHER_VIEW.isdisjoint(reasons):
                break
            try:
                yield work.go({work.table: angle})
            except MoveRefused as refusal:
                if isinstance(refusal, StoppedError):
                    raise
                logger.warning("the plate is not looked at from another side: %s", refusal)
                break
            together += [each for each in work.shared.unsuitable if each.problem in LYING_TOGETHER]
            yield from self._look(work, before, together)
            reasons |= work.shared.skip_reasons - Counter({TOO_FAINT: len(work.shared.unsuitable)})
        if not work.shared.candidates:
            work.shared.skip_reasons = reasons
            raise OperationFailed(NONE_LEFT, none_left(reasons))
        yield SAFE_POINT

    def _look(
        self, work: HandlingContext, before: list[Floats], together: Sequence[Candidate] = ()
    ) -> Steps:
        image = yield work.image()
        assert isinstance(image, CameraImage)
        mapped = work.mapped(image)
        look(work, find_seen(image, mapped), before, together)


def views_deg(angle_deg: float, settings: GraspSettings) -> list[float]:
    """Return the angles of the table at which a plate is looked at again, from where it stands."""
    largest = settings.largest_turn_deg
    turns = [VIEW_DEG * turn for turn in (1, -1, 2, -2)]
    return [angle_deg + turn for turn in turns if abs(angle_deg + turn) <= largest][
        : settings.views - 1
    ]


def none_left(skip_reasons: Mapping[str, int]) -> str:
    """Return what is said where no fibre can be taken up, and what to do.

    Parameters
    ----------
    skip_reasons : mapping of str to int
        Why fibres on the plate are not taken, and how many.
    """
    empty = "the plate is empty: put a sample there, or check light and focus"
    if not skip_reasons:
        return empty
    reasons = ", ".join(f"{count} {why}" for why, count in sorted(skip_reasons.items()))
    if set(skip_reasons) == {TOO_FAINT}:
        # The noise of an image alone brings such a sighting now and then.
        return f"{empty} ({reasons} to be told from the noise)"
    return f"none on the plate can be grasped ({reasons}): spread them, or put another sample there"


def look(
    work: HandlingContext,
    seen: list[SeenFibre],
    before: list[Floats] | None = None,
    together: Sequence[Candidate] = (),
) -> None:
    """Take note of what lies on the plate, and of what may be taken.

    Parameters
    ----------
    before : list of ndarray, optional
        What lay there when it was surveyed before; what was seen last, if None.
    together : sequence of Candidate
        Those that were seen to lie with others, from another side.
    """
    angle, frame = work.table_deg, work.calibration.frame
    found = [_candidate(work, each, frame.on_plate(each.line_um, angle)) for each in seen]
    standard = standard_among(found, work.settings.standard)
    before = work.shared.lines_um if before is None else before
    work.shared.lines_um = [each.line_um for each in found]
    work.shared.standard = None
    if standard is not None and not (standard.problem or _crowded(work, standard)):
        work.shared.standard = standard
    checked = [
        replace(
            each,
            problem=each.problem
            or _of_standard(work, each)
            or _lonely(work, each)
            or next((other.problem for other in together if same_fibre(each, other)), ""),
        )
        for each in found
        if each is not standard
    ]
    checked = leave_dropped(checked, work.shared.dropped)
    checked = _leave_fallen(work, checked, before)
    work.shared.candidates = [each for each in checked if not each.problem]
    work.shared.unsuitable = [each for each in checked if each.problem]
    work.shared.skip_reasons = Counter(each.problem for each in work.shared.unsuitable)
    work.shared.surveyed, work.shared.since_survey, work.shared.survey_deg = True, 0, angle
    work.shared.surveys += 1


def _leave_fallen(
    work: HandlingContext, candidates: list[Candidate], before: list[Floats]
) -> list[Candidate]:
    """Return the sightings; one like a measured fibre, where nothing lay before, is not taken.

    It clung to the jaws, was seen nowhere, and fell when nobody looked.
    """
    here = work.shared.finished[work.shared.plate_from :]
    measured = [each for each in here if each.bending is not None]
    left = []
    for each in candidates:
        new = not any(within_um(each.line_um, line, SAME_UM) for line in before)
        if before and new and any(_unlike(each, fibre) < 1.0 for fibre in measured):
            work.shared.skipped.append(each)
            left.append(replace(each, problem=MEASURED))
        else:
            left.append(each)
    return left


def _candidate(work: HandlingContext, seen: SeenFibre, line_um: Floats) -> Candidate:
    settings, doubts = work.settings.grasp, " ".join(seen.fibre.doubts)
    tried = not seen.fibre.certain and _worth_trying(seen, settings)
    problem = ""
    if "hardly stands out" in doubts:
        problem = TOO_FAINT
    elif "border" in doubts:
        problem = OUT_OF_FIELD
    elif "cross" in doubts or "branch" in doubts or "several" in doubts:
        problem = CROSSING
    elif not (seen.fibre.certain or tried):
        problem = NOT_CERTAIN
    elif seen.length_um < settings.shortest_um:
        problem = TOO_SHORT
    elif seen.length_um > settings.longest_um:
        problem = TOO_LONG
    elif seen.fibre.curl > settings.curliest:
        problem = TOO_CURLED
    return Candidate(
        line_um,
        seen.length_um,
        seen.width_um,
        seen.fibre.curl,
        seen.fibre.contrast,
        problem,
        seen.length_std_um,
        seen.width_std_um,
        seen.curl_std,
        doubted=not seen.fibre.certain,
        probability=seen.fibre.probability if tried else math.nan,
    )


def _worth_trying(seen: SeenFibre, settings: GraspSettings) -> bool:
    """Return whether it is only doubted that all of the fibre is seen, and little."""
    known = all(any(words in doubt for words in WHOLE_OR_NOT) for doubt in seen.fibre.doubts)
    return known and seen.fibre.probability >= settings.least_probability


def standard_among(found: list[Candidate], settings: StandardSettings) -> Candidate | None:
    """Return the sighting of the standard: straight, as long as it is, and near where it lies."""
    if not settings.ei_n_m2 > 0.0:
        return None
    fitting = [
        (abs(each.length_um / settings.length_um - 1.0), number)
        for number, each in enumerate(found)
        if each.curl <= STANDARD_CURL
        and abs(each.length_um / settings.length_um - 1.0) <= STANDARD_LENGTH
        and math.dist(each.position_um, (settings.x_um, settings.y_um)) <= settings.within_um
    ]
    return found[min(fitting)[1]] if fitting else None


def _of_standard(work: HandlingContext, candidate: Candidate) -> str:
    """Return why something that may be a part of the standard is left where it lies."""
    standard = work.settings.standard
    near = math.dist(candidate.position_um, (standard.x_um, standard.y_um)) <= standard.within_um
    straight = candidate.curl <= 2.0 * STANDARD_CURL
    mine = standard.ei_n_m2 > 0.0 and candidate.doubted and near and straight
    return NOT_CERTAIN if mine else ""


def _lonely(work: HandlingContext, candidate: Candidate) -> str:
    if any(same_fibre(candidate, each) for each in work.shared.skipped):
        return SKIPPED
    return _crowded(work, candidate)


def _crowded(work: HandlingContext, candidate: Candidate) -> str:
    near = (
        within_um(candidate.line_um, line, work.settings.grasp.clear_um)
        for line in work.shared.lines_um
        if line is not candidate.line_um
    )
    return TOO_NEAR if any(near) else ""


def same_fibre(one: Candidate, other: Candidate) -> bool:
    """Return whether two sightings on the plate are of one fibre."""
    (x0, y0), (x1, y1) = one.position_um, other.position_um
    near = abs(x0 - x1) < SAME_UM and abs(y0 - y1) < SAME_UM
    return near and abs(one.length_um - other.length_um) < SAME_LENGTH * other.length_um


def leave_dropped(candidates: list[Candidate], dropped: list[HeldFibre]) -> list[Candidate]:
    """Return the sightings; of each fibre that fell the one most like it is not to be taken."""
    left = list(candidates)
    for fibre in dropped:
        likes = [(_unlike(each, fibre), number) for number, each in enumerate(left)]
        unlike, number = min(likes, default=(math.inf, 0))
        if unlike < 1.0:
            left[number] = replace(left[number], problem=MEASURED)
    return left


def _unlike(one: Candidate, other: HeldFibre) -> float:
    """Return how little a sighting is like a fibre that was measured; 1 and more is another."""
    if one.problem:
        return math.inf
    width = abs(one.width_um / other.width_um - 1.0) / DROPPED_WIDTH
    if one.doubted:  # it may be a part of it; one that is seen whole is more like it
        return max(width, PART_UNLIKE)
    return max(
        abs(one.length_um / other.length_um - 1.0) / DROPPED_LENGTH,
        width,
        abs(one.curl - other.curl) / DROPPED_CURL,
    )


class Choose(FibreOperation):
    """The fibre that is got at with the smallest turn of the table."""

    name = "choose a fibre"

    @override
    def steps(self, work: HandlingContext) -> Steps:
        angle = work.table_deg
        approaches = [
            approach
            for each in work.shared.candidates
            for approach in approaches_of(work, each, angle)
        ]
        best = min(approaches, key=lambda each: self.rank(work, each, angle), default=None)
        if best is None:
            raise self.none(work)
        take(work, best)
        yield SAFE_POINT

    def rank(self, work: HandlingContext, approach: Reach, angle_deg: float) -> tuple[float, ...]:  # noqa: ARG002
        """Return by what the best way is known: the smallest."""
        doubted = approach.candidate.doubted
        return approach.under, doubted, abs(approach.angle_deg - angle_deg)

    def none(self, work: HandlingContext) -> OperationFailed:
        """Return what it fails with where none can be taken."""
        if work.shared.candidates:
            work.shared.skip_reasons[OUT_OF_REACH] += len(work.shared.candidates)
        work.shared.candidates = []
        cause = LOOK_AGAIN if work.shared.since_survey else NONE_LEFT
        return OperationFailed(cause, none_left(work.shared.skip_reasons))


def approaches_of(work: HandlingContext, candidate: Candidate, angle_deg: float) -> list[Reach]:
    """Return the ways to take a candidate, the best first."""
    own = candidate.line_um.mean(axis=0)
    others = [
        line for line in work.shared.lines_um if np.linalg.norm(line.mean(axis=0) - own) > OWN_UM
    ]
    return reaches(
        candidate,
        work.calibration.frame,
        work.jaws,
        work.settings.grasp,
        Neighbours(others, work.shared.obstacles_um),
        angle_deg,
    )


def sighted(work: HandlingContext) -> list[Candidate]:
    """Return all that the last survey saw, each with the problem for which it is not taken."""
    return [
        *(
            each if _reached(work, each) else replace(each, problem=OUT_OF_REACH)
            for each in work.shared.candidates
        ),
        *work.shared.unsuitable,
    ]


def can_be_taken(work: HandlingContext) -> bool:
    """Return whether the last survey saw a fibre that is taken, and within reach."""
    return any(_reached(work, each) for each in work.shared.candidates)


def _reached(work: HandlingContext, candidate: Candidate) -> bool:
    return any(approaches_of(arm, candidate, arm.table_deg) for arm in work.arms)


def take(work: HandlingContext, approach: Reach, *, standard: bool = False) -> None:
    """Note that a candidate is to be taken up."""
    candidate = approach.candidate
    work.shared.candidates = [each for each in work.shared.candidates if each is not candidate]
    gone = candidate.line_um.mean(axis=0)
    work.shared.lines_um = [
        line for line in work.shared.lines_um if np.linalg.norm(line.mean(axis=0) - gone) > OWN_UM
    ]
    work.shared.numbers += 1
    work.shared.since_survey += 1
    work.fibre = HeldFibre(
        work.shared.numbers, approach, found_s=work.clock.now_s(), standard=standard
    )
    if work.beside_another:
        work.fibre.arm = work.settings.gripper
    else:
        work.forces.take_peak_un()
