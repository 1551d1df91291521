"""The shipped procedures on the twin, through the scripted API only; scored by its truth."""

import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from types import SimpleNamespace

import pytest

import cosmic
from cosmic.autonomy.handling.context import HandlingContext
from cosmic.autonomy.handling.held_fibre import HeldFibre
from cosmic.autonomy.handling.settings import HandlingSettings, PushSettings
from cosmic.autonomy.procedures.failures import ProcedureStopped
from cosmic.autonomy.procedures.operation import OperationFailed
from cosmic.autonomy.procedures.procedure import Procedure
from cosmic.autonomy.procedures.run import ProcedureRun
from cosmic.autonomy.procedures.tree import NodeEvent, NodeState
from cosmic.autonomy.shipped.bend_test import build_bend_test, build_transport
from cosmic.frame.failure import FailurePolicy
from cosmic.twin.truth import TrueFibre, TruthRecord, read_truth

CONFIG = Path(cosmic.__file__).parents[2] / "config"
RATE = 8.0
# The limit has a dead man of a tenth of a second of the wall, which a busy machine oversleeps.
SETTINGS = HandlingSettings(push=PushSettings(stop_un=0.0))
LIMIT_UN = 0.8 * 180.0


@contextmanager
def sample(
    name: str, truth: Path, seed: int = 0, config: Path | None = None
) -> Iterator[SimpleNamespace]:
    with cosmic.connect(config=config, sample=name, rate=RATE, seed=seed, truth=truth) as rig:
        work = HandlingContext.on(rig, SETTINGS)
        try:
            yield SimpleNamespace(rig=rig, work=work)
        finally:
            work.close()


def carried_out(work: HandlingContext, procedure: Procedure[HandlingContext]) -> HeldFibre:
    ProcedureRun(procedure, work, work.clock, FailurePolicy()).run_here()
    return work.shared.finished[-1]


def true_fibre(record: TruthRecord, fibre: HeldFibre) -> TrueFibre:
    """Return the one that was grasped while `fibre` was in hand."""
    grasped = [
        each.facts["fibre"]
        for each in record.of("grasped")
        if fibre.found_s <= each.time_s <= fibre.done_s
    ]
    (number,) = set(grasped)
    return next(each for each in record.fibres if each.number == number)


def check(record: TruthRecord, fibre: HeldFibre, *, fell: bool = False) -> None:
    """See that what was measured is what is true."""
    true, found = true_fibre(record, fibre), fibre.bending
    assert found is not None
    assert found.trusted, found.reasons
    assert found.ei_n_m2 == pytest.approx(true.ei_n_m2, rel=0.10)
    assert fibre.length_um == pytest.approx(true.length_um, rel=0.02)
    assert fibre.peak_un <= LIMIT_UN
    assert fibre.put_away
    assert fell or record.of("released", true.number)


def unintended(record: TruthRecord) -> set[frozenset[str]]:
    """Return which bodies touched that never should; jaws are let down on the plate."""
    jaws = {"left_jaw_a", "left_jaw_b", "plate"}
    pairs = {frozenset(each.facts["bodies"]) for each in record.of("contact")}
    return {pair for pair in pairs if not pair <= jaws}


@pytest.mark.slow
def test_a_fibre_is_found_taken_up_bent_and_put_away(tmp_path: Path):
    truth = tmp_path / "truth.jsonl"
    with sample("three-dry", truth) as bench:
        fibre = carried_out(bench.work, build_bend_test(SETTINGS))
        assert not bench.work.failures
        assert {"geometry", "held"} <= set(fibre.images)
        assert len(fibre.spans) == SETTINGS.push.spans.count
    first, *others = (each.bent for each in fibre.spans)
    assert first is not None, "the longest push was looked at"
    assert len(first.ahead_um) > 15
    assert first.aside_um[-1] > 10.0 * first.std_um
    assert others == [None] * len(others)
    record = read_truth(truth)
    check(record, fibre)
    assert unintended(record) == set()


@pytest.mark.slow
def test_three_fibres_are_measured_one_after_the_other_and_then_none_is_left(tmp_path: Path):
    truth = tmp_path / "truth.jsonl"
    with sample("three-dry", truth, seed=2) as bench:
        fibres = [carried_out(bench.work, build_bend_test(SETTINGS)) for _ in range(3)]
        with pytest.raises(Exception, match="no fibre"):
            carried_out(bench.work, build_bend_test(SETTINGS))
    record = read_truth(truth)
    for fibre in fibres:
        check(record, fibre)
    assert len({true_fibre(record, fibre).number for fibre in fibres}) == 3
    assert unintended(record) == set()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fault", "operation", "cause"),
    [
        ("missed_grasp", "lift and see that it follows", "missed grasp"),
        ("jaw_adhesion", "release", "jaw adhesion"),
    ],
)
def test_a_single_fault_is_recovered_from_alone(
    fault: str, operation: str, cause: str, tmp_path: Path
):
    truth = tmp_path / "truth.jsonl"
    with sample("three-dry", truth, seed=3) as bench:
        bench.rig.faults.inject(fault)
        fibre = carried_out(bench.work, build_bend_test(SETTINGS))
        failed = [(name, failure.cause) for name, failure in bench.work.failures]
        assert (operation, cause) in failed
    check(read_truth(truth), fibre)


@pytest.mark.slow
@pytest.mark.parametrize("fault", ["slip_in_lift", "drop"])
def test_a_fibre_that_was_lost_on_the_path_is_found_and_measured_all_the_same(
    fault: str, tmp_path: Path
):
    truth = tmp_path / "truth.jsonl"
    with sample("three-dry", truth, seed=8) as bench:
        bench.rig.faults.inject(fault)
        failures: list[str] = []
        while "no fibre" not in failures:
            try:
                carried_out(bench.work, build_bend_test(SETTINGS))
            except OperationFailed as failure:
                failures.append(failure.cause)
        good = [each for each in bench.work.shared.finished if each.failure is None]
    record = read_truth(truth)
    assert set(failures) <= {"dropped", "lost", "no fibre"}
    for fibre in good:
        check(record, fibre, fell=bool(record.of("dropped", true_fibre(record, fibre).number)))
    assert len(good) == 3, "none is measured twice"
    assert {true_fibre(record, fibre).number for fibre in good} == {0, 1, 2}


@pytest.mark.slow
def test_a_fibre_that_broke_off_is_not_taken_for_held_because_it_lies_right_below(tmp_path: Path):
    brittle = tmp_path / "config"
    shutil.copytree(CONFIG, brittle)
    text = (brittle / "twin.toml").read_text(encoding="utf-8")
    text = re.sub(r"(?m)^weak_strain_high = .*$", "weak_strain_high = 0.0008", text)
    (brittle / "twin.toml").write_text(text, encoding="utf-8")
    with sample("three-dry", tmp_path / "truth.jsonl", seed=2, config=brittle) as bench:
        bench.rig.faults.inject("fibre_break")
        with pytest.raises(OperationFailed, match="no longer in the jaws") as failure:
            carried_out(bench.work, build_bend_test(SETTINGS))
        failed = [(name, each.cause) for name, each in bench.work.failures]
    assert failure.value.cause == "dropped"
    assert failed.count(("push the spans", "no contact")) == 1, "nothing is pushed where it was"


@pytest.mark.slow
def test_jaws_follow_a_fibre_that_a_draught_moves_as_they_come_down(tmp_path: Path):
    truth = tmp_path / "truth.jsonl"
    blind = SETTINGS.model_copy(
        update={"grasp": SETTINGS.grasp.model_copy(update={"follow_um": 0.0})}
    )
    with sample("three-dry", truth, seed=2) as bench:
        carried_out(bench.work, build_transport(SETTINGS))
        bench.rig.faults.inject("draught", amount=140.0)
        followed = carried_out(bench.work, build_transport(SETTINGS))
        bench.work.settings = blind
        bench.rig.faults.inject("draught", amount=140.0)
        with pytest.raises(OperationFailed):
            carried_out(bench.work, build_transport(blind))
    record = read_truth(truth)
    assert followed.failure is None
    blown = [each.facts["fibre"] for each in record.of("blown")]
    grasped = [each.facts["fibre"] for each in record.of("grasped")]
    assert len(blown) == 2
    assert blown[0] in grasped[1:]
    assert blown[1] not in grasped
    assert unintended(record) == set()


@pytest.mark.slow
def test_a_fibre_is_only_carried_where_nothing_is_to_be_measured(tmp_path: Path):
    with sample("three-dry", tmp_path / "truth.jsonl", seed=5) as bench:
        fibre = carried_out(bench.work, build_transport(SETTINGS))
        assert fibre.put_away
        assert fibre.spans == []


@pytest.mark.slow
def test_an_empty_plate_is_said_to_be_empty(tmp_path: Path):
    with (
        sample("empty", tmp_path / "truth.jsonl") as bench,
        pytest.raises(Exception, match="no fibre"),
    ):
        carried_out(bench.work, build_transport(SETTINGS))


@pytest.mark.slow
def test_after_a_stop_in_mid_air_the_next_run_puts_away_what_it_finds_in_the_jaws(tmp_path: Path):
    truth = tmp_path / "truth.jsonl"
    with sample("three-dry", truth, seed=6) as bench:
        rig, work = bench.rig, bench.work
        procedure = build_bend_test(SETTINGS)
        run = ProcedureRun(procedure, work, work.clock, FailurePolicy())

        def stop_there(event: NodeEvent) -> None:
            if event.name == "push the spans" and event.state is NodeState.RUNNING:
                rig.stop("somebody pressed the key")

        run.subscribe(stop_there)
        with pytest.raises(ProcedureStopped, match="somebody pressed the key"):
            run.run_here()
        assert work.fibre is not None
        rig.reset_stop()
        fibre = carried_out(work, procedure)
        left = work.shared.finished[-2]
    record = read_truth(truth)
    assert left.failure is not None
    assert left.failure.cause == "interrupted"
    assert len(record.of("released")) == 2
    check(record, fibre)
    assert unintended(record) == set()
