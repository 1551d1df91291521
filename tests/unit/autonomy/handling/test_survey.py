"""What of a survey may be taken up, and why the rest may not."""

import math
import re
from typing import Any

import numpy as np
import pytest
from typing_extensions import override

from cosmic.autonomy.campaign.recorder import record_of
from cosmic.autonomy.handling import survey
from cosmic.autonomy.handling.context import HandlingContext
from cosmic.autonomy.handling.plate import Jaws, PlateFrame
from cosmic.autonomy.handling.settings import HandlingSettings, StandardSettings
from cosmic.autonomy.handling.survey import Choose, look
from cosmic.autonomy.procedures.operation import OperationFailed
from cosmic.frame.clock import ManualClock
from cosmic.frame.errors import MoveRefused
from cosmic.frame.verdict import MoveVerdict, Reason
from cosmic.vico.core.vision.beyond import GOES_ON, SOFT
from cosmic.vico.core.vision.certainty import IMPROBABLE
from cosmic.vico.core.vision.checks import CONTINUES, PARTED

SCALE_UM_PX = 7.6
FAINT = "hardly stands out from the noise"


class Bench(HandlingContext):
    """A plate to look at; nothing that could move."""

    def __init__(self) -> None:
        none: Any = None
        super().__init__(none, none, none, HandlingSettings(), ManualClock(), Peak())  # type: ignore[arg-type]

    @property
    @override
    def table_deg(self) -> float:
        return 0.0

    @property
    @override
    def jaws(self) -> Any:
        return Jaws()


class Peak:
    """Stands for the force."""

    def take_peak_un(self) -> float:
        return 0.0


class Seen:
    """A fibre on an image, as much of it as a survey looks at."""

    def __init__(
        self,
        x_um: float,
        y_um: float,
        *,
        length_um: float = 1200.0,
        angle_deg: float = 60.0,
        curl: float = 0.01,
        doubts: tuple[str, ...] = (),
        probability: float = 1.0,
    ) -> None:
        way = np.linspace(-length_um / 2, length_um / 2, 80)
        angle = math.radians(angle_deg)
        self.line_um = np.column_stack([x_um + way * math.cos(angle), y_um + way * math.sin(angle)])
        self.length_um, self.width_um = length_um, 30.0
        self.length_std_um, self.width_std_um, self.curl_std = 2.0, 1.5, 0.001
        self.fibre: Any = self
        self.curl, self.doubts, self.certain, self.contrast = curl, doubts, not doubts, 60.0
        self.probability = probability


def looked(*seen: Seen) -> Bench:
    bench = Bench()
    look(bench, list(seen))  # type: ignore[arg-type]
    return bench


@pytest.mark.parametrize(
    ("seen", "problem"),
    [
        (Seen(0.0, 0.0, length_um=300.0), survey.TOO_SHORT),
        (Seen(0.0, 0.0, length_um=5000.0), survey.TOO_LONG),
        (Seen(0.0, 0.0, curl=0.4), survey.TOO_CURLED),
        (Seen(0.0, 0.0, doubts=("a crossing can be read in two ways",)), survey.CROSSING),
        (Seen(0.0, 0.0, doubts=("the image's border cuts it off",)), survey.OUT_OF_FIELD),
        (Seen(0.0, 0.0, doubts=("it runs into something wider",)), survey.NOT_CERTAIN),
        (Seen(0.0, 0.0, doubts=(FAINT, "the image's border cuts it off")), survey.TOO_FAINT),
    ],
)
def test_what_is_not_taken_is_counted_by_its_reason(seen: Seen, problem: str):
    bench = looked(seen)
    assert bench.shared.candidates == []
    assert bench.shared.skip_reasons == {problem: 1}


WHOLE_OR_NOT = (IMPROBABLE, CONTINUES, GOES_ON, SOFT)


@pytest.mark.parametrize("doubt", WHOLE_OR_NOT)
def test_one_that_is_probably_whole_is_taken_and_said_to_be_doubted(doubt: str):
    bench = looked(Seen(0.0, 0.0, doubts=(doubt,), probability=0.7))
    assert [each.doubted for each in bench.shared.candidates] == [True]
    bench = looked(Seen(0.0, 0.0, doubts=(doubt,), probability=0.3))
    assert bench.shared.skip_reasons == {survey.NOT_CERTAIN: 1}


def test_what_else_is_doubted_is_left_however_probable():
    for doubts in ((PARTED,), (IMPROBABLE, PARTED)):
        bench = looked(Seen(0.0, 0.0, doubts=doubts, probability=0.99))
        assert bench.shared.skip_reasons == {survey.NOT_CERTAIN: 1}


def test_a_certain_fibre_is_taken_before_one_that_is_doubted():
    near = Seen(0.0, 0.0, angle_deg=2.0, doubts=(CONTINUES,), probability=0.9)
    bench = looked(near, Seen(-1500.0, 900.0, angle_deg=60.0))
    taken = []
    for _ in range(2):
        for _ in Choose().run(bench):
            pass
        taken.append(bench.held_fibre().reach.candidate.doubted)
    assert taken == [False, True]
    record = record_of(
        bench.held_fibre(), 1, ended_s=1.0, measures=False, images=False, events=(), series=()
    )
    assert record.shape.probability == 0.9
    assert record.shape.doubted


def test_what_may_be_a_part_of_the_standard_stays_where_it_is():
    bench = Bench()
    bench.settings = HandlingSettings(standard=StandardSettings(ei_n_m2=1.79e-10))
    part = Seen(0.0, -3800.0, length_um=1850.0, curl=0.001, doubts=(SOFT,), probability=0.9)
    look(bench, [part])  # type: ignore[list-item]
    assert bench.shared.skip_reasons == {survey.NOT_CERTAIN: 1}


def test_a_part_of_one_that_was_measured_and_fell_is_not_measured_again():
    bench = looked(Seen(0.0, 0.0))
    for _ in Choose().run(bench):
        pass
    bench.shared.dropped.append(bench.held_fibre())
    part = Seen(-1500.0, 0.0, length_um=1100.0, doubts=(CONTINUES,), probability=0.9)
    look(bench, [part])  # type: ignore[list-item]
    assert bench.shared.skip_reasons == {survey.MEASURED: 1}


class Turning(Bench):
    """A plate that turns, on which other fibres are seen at other angles."""

    def __init__(self, *views: list[Seen]) -> None:
        super().__init__()
        self.angle_deg, self.views = 10.0, list(views)
        self.seen_at: list[float] = []
        self.refusal: MoveRefused | None = None

    @property
    @override
    def table_deg(self) -> float:
        return self.angle_deg

    @property
    @override
    def table(self) -> str:
        return "table.rotation"

    @override
    def image(self) -> Any:
        return "image"

    @override
    def mapped(self, image: Any, height_um: float | None = None) -> Any:
        return None

    @override
    def go(self, targets: Any) -> Any:
        if self.refusal is not None:
            raise self.refusal
        return targets

    def look_at_it(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """Carry the survey out."""

        def found(_image: Any, _mapped: Any) -> list[Seen]:
            self.seen_at.append(self.angle_deg)
            return self.views.pop(0) if self.views else []

        monkeypatch.setattr(survey, "clear_image", lambda _: iter(()))
        monkeypatch.setattr(survey, "find_seen", found)
        monkeypatch.setattr(survey, "CameraImage", str)
        steps = survey.Survey().steps(self)
        answer: Any = None
        while True:
            try:
                asked = steps.send(answer)
            except StopIteration:
                return
            if isinstance(asked, dict):
                (self.angle_deg,) = asked.values()
            answer = asked


UNSURE = Seen(0.0, 0.0, doubts=(PARTED,))


def test_where_nothing_can_be_taken_the_plate_is_looked_at_from_other_sides(
    monkeypatch: pytest.MonkeyPatch,
):
    bench = Turning([UNSURE], [], [Seen(0.0, 0.0)])
    bench.look_at_it(monkeypatch)
    assert bench.seen_at == [10.0, 80.0, -60.0]
    assert len(bench.shared.candidates) == 1
    assert bench.shared.survey_deg == -60.0


def test_what_crosses_another_is_left_from_whichever_side_that_was_seen(
    monkeypatch: pytest.MonkeyPatch,
):
    crossing = Seen(2000.0, 500.0, doubts=("a crossing can be read in two ways",))
    alone = Seen(2000.0, 500.0, doubts=(IMPROBABLE,), probability=0.99)
    plate = PlateFrame()
    alone.line_um = plate.on_platform(plate.on_plate(crossing.line_um, 10.0), 80.0)
    bench = Turning([UNSURE, crossing], [UNSURE, alone], [UNSURE])
    with pytest.raises(OperationFailed) as failed:
        bench.look_at_it(monkeypatch)
    assert failed.value.cause == survey.NONE_LEFT
    assert "1 crossing" in str(failed.value)


def test_noise_that_one_side_shows_is_no_reason(monkeypatch: pytest.MonkeyPatch):
    bench = Turning([UNSURE], [UNSURE, Seen(2000.0, 500.0, doubts=(FAINT,))], [UNSURE])
    with pytest.raises(OperationFailed, match=r"\(1 not certain\)"):
        bench.look_at_it(monkeypatch)


def test_a_plate_that_may_not_be_turned_has_nothing_left(monkeypatch: pytest.MonkeyPatch):
    bench = Turning([UNSURE])
    bench.refusal = MoveRefused(
        MoveVerdict(allowed=False, reason=Reason.COLLISION, text="a jaw is in the way")
    )
    with pytest.raises(OperationFailed) as failed:
        bench.look_at_it(monkeypatch)
    assert failed.value.cause == survey.NONE_LEFT
    assert "1 not certain" in str(failed.value)


@pytest.mark.parametrize(
    ("views", "angles"),
    [
        ([[UNSURE]] * 4, [10.0, 80.0, -60.0]),
        ([[]] * 4, [10.0]),
        ([[Seen(0.0, 0.0, length_um=300.0)]] * 4, [10.0]),
    ],
    ids=["seen from three sides", "empty", "no side would help"],
)
def test_after_some_sides_nothing_is_left(
    views: list[list[Seen]], angles: list[float], monkeypatch: pytest.MonkeyPatch
):
    bench = Turning(*views)
    with pytest.raises(OperationFailed) as failed:
        bench.look_at_it(monkeypatch)
    assert failed.value.cause == survey.NONE_LEFT
    assert bench.seen_at == angles


@pytest.mark.parametrize(
    ("reasons", "message"),
    [
        ({}, "^the plate is empty: put a sample there, or check light and focus$"),
        ({survey.TOO_FAINT: 2}, r"^the plate is empty: .*light and focus \(2 too faint to be told"),
        ({survey.TOO_FAINT: 2, survey.CROSSING: 1}, r"can be grasped \(1 crossing, 2 too faint\)"),
    ],
    ids=["nothing", "noise", "noise and fibres"],
)
def test_noise_on_an_image_is_no_fibre_on_the_plate(reasons: dict[str, int], message: str):
    assert re.search(message, survey.none_left(reasons))


def test_two_that_lie_close_together_are_both_left():
    bench = looked(Seen(0.0, 0.0), Seen(40.0, 0.0), Seen(2000.0, 500.0))
    assert [each.position_um for each in bench.shared.candidates] == [
        pytest.approx((2000.0, 500.0))
    ]
    assert bench.shared.skip_reasons == {survey.TOO_NEAR: 2}


def test_one_that_was_skipped_is_not_chosen_again():
    bench = looked(Seen(0.0, 0.0))
    bench.shared.skipped = list(bench.shared.candidates)
    look(bench, [Seen(20.0, -15.0), Seen(-1500.0, 900.0)])  # type: ignore[list-item]
    assert len(bench.shared.candidates) == 1
    assert bench.shared.skip_reasons == {survey.SKIPPED: 1}


def test_one_that_was_measured_and_fell_is_known_again_wherever_it_lies():
    bench = looked(Seen(0.0, 0.0))
    for _ in Choose().run(bench):
        pass
    bench.shared.dropped.append(bench.held_fibre())
    there = Seen(3000.0, 1000.0, angle_deg=5.0)
    look(bench, [Seen(-1500.0, 0.0, length_um=1202.0), there])  # type: ignore[list-item]
    assert [each.length_um for each in bench.shared.candidates] == [1202.0], (
        "the most alike is left"
    )
    assert bench.shared.skip_reasons == {survey.MEASURED: 1}


@pytest.mark.parametrize(
    ("length_um", "taken"), [(1200.0, False), (1260.0, True)], ids=["like it", "another"]
)
def test_one_that_clung_and_fell_unseen_is_not_measured_again(length_um: float, taken: bool):
    bench = looked(Seen(0.0, 0.0), Seen(-2500.0, 800.0, length_um=1500.0))
    for _ in Choose().run(bench):
        pass
    done = bench.held_fibre()
    done.bending = object()  # type: ignore[assignment]
    bench.shared.finished.append(done)
    lies = Seen(-2500.0, 800.0, length_um=1500.0)
    for _ in range(2):
        look(bench, [lies, Seen(-3000.0, -3000.0, length_um=length_um)])  # type: ignore[list-item]
        lengths = [each.length_um for each in bench.shared.candidates]
        assert lengths == ([1500.0, length_um] if taken else [1500.0])


def test_each_is_chosen_once_and_the_last_choice_says_to_look_again():
    bench = looked(Seen(0.0, 0.0), Seen(-2500.0, 800.0))
    places = set()
    for _ in range(2):
        for _ in Choose().run(bench):
            pass
        places.add(bench.held_fibre().reach.candidate.position_um)
    assert len(places) == 2
    with pytest.raises(OperationFailed) as failed:
        next(Choose().run(bench))
    assert failed.value.cause == survey.LOOK_AGAIN


def test_a_plate_with_nothing_on_it_is_said_to_have_no_fibre():
    with pytest.raises(OperationFailed, match="the plate is empty") as failed:
        next(Choose().run(looked()))
    assert failed.value.cause == survey.NONE_LEFT


def with_standard(*seen: Seen) -> Bench:
    bench = Bench()
    beam = StandardSettings(ei_n_m2=1.8e-10, length_um=2000.0, x_um=0.0, y_um=-3900.0)
    bench.settings = bench.settings.model_copy(update={"standard": beam})
    look(bench, list(seen))  # type: ignore[arg-type]
    return bench


STANDARD = {"length_um": 2000.0, "angle_deg": 0.0, "curl": 0.0005}


def test_the_standard_is_known_by_position_length_and_straightness() -> None:
    bench = with_standard(
        Seen(100.0, -3850.0, **STANDARD),  # type: ignore[arg-type]
        Seen(0.0, 500.0, **STANDARD),  # type: ignore[arg-type]
        Seen(-100.0, -3500.0, length_um=1500.0, angle_deg=0.0),
    )
    assert bench.shared.standard is not None
    assert bench.shared.standard.position_um == pytest.approx((100.0, -3850.0))
    assert len(bench.shared.candidates) == 2


def test_the_standard_is_never_taken_as_a_fibre_also_where_it_cannot_be_bent() -> None:
    bench = with_standard(
        Seen(0.0, -3900.0, **STANDARD),  # type: ignore[arg-type]
        Seen(300.0, -3890.0, angle_deg=0.0),
    )
    assert bench.shared.standard is None
    assert not bench.shared.candidates


def test_without_a_certificate_a_straight_fibre_is_a_fibre() -> None:
    bench = looked(Seen(0.0, -3900.0, **STANDARD))  # type: ignore[arg-type]
    assert bench.shared.standard is None
    assert len(bench.shared.candidates) == 1
