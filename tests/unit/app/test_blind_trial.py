"""A blind trial: the truth is opened once the analysis is frozen, and not one push earlier."""

import hashlib
import json
from pathlib import Path

import pytest

from cosmic.app.blind_trial import (
    Measured,
    SealedSession,
    TrialError,
    TrialResult,
    TrialRow,
    digest_of,
    run_session,
    sealed_program,
    table_of,
)
from cosmic.app.cli import main
from cosmic.app.commands.blind_trial import true_of
from cosmic.autonomy.campaign.records import FibreRecord, Outcome
from cosmic.twin.truth import TruthEvent, TruthRecord

LYING = """
import json, sys
sys.stdin.readline()
answers = [
    {"seal": "0" * 64, "standard_ei_n_m2": 6e-11, "standard_expanded_part": 0.02, "range_un": 180},
    {"seed": "1", "ei_n_m2": []},
]
for each in answers:
    print(json.dumps(each), flush=True)
    sys.stdin.readline()
"""


def measured(number: int, ei: float, half_percent: float, *, trusted: bool = True) -> Measured:
    half = ei * half_percent / 100.0
    return Measured(number, ei, ei - half, ei + half, trusted, half_percent)


def test_a_session_is_measured_frozen_and_opened() -> None:
    found = run_session("friendly", 2, secret=5)
    assert found.seal == hashlib.sha256(b"5").hexdigest()
    assert found.frozen == digest_of([row.measured for row in found.rows])
    assert found.scale.startswith("verified")
    assert [row.measured.number for row in found.rows] == [0, 1]
    assert all(abs(row.error_percent) < 25.0 for row in found.rows)


def test_seal_and_hash_of_the_analysis_are_published_before_what_they_are_of() -> None:
    said: list[str] = []
    found = run_session("friendly", 1, secret=5, publish=said.append)
    assert said == [f"sealed: {found.seal}", f"frozen: {found.frozen}"]
    assert hashlib.sha256(found.secret.encode()).hexdigest() == found.seal
    assert f"secret {found.secret}" in table_of([found])[0]
    again = run_session("friendly", 1, secret=int(found.secret))
    assert again.rows[0].true_n_m2 == found.rows[0].true_n_m2


HEAD = {"seal": "x", "standard_ei_n_m2": 6e-11, "standard_expanded_part": 0.02, "range_un": 180}
LINE = {"line_um": [[0.0, 0.0], [500.0, 0.0], [1000.0, 0.0]]}


@pytest.mark.parametrize(
    "answers",
    [
        [{}],
        [HEAD | {"range_un": "many"}],
        [HEAD | {"standard_ei_n_m2": 0.0}],
        [HEAD, {}],
        [HEAD, {"line_um": [1.0]}],
        [HEAD, {"line_um": []}],
        [HEAD, LINE, {}],
        [HEAD, LINE, {name: [1.0] for name in ("way_um", "force_un", "time_s", "loading")}],
        [
            HEAD,
            LINE,
            {"way_um": [1, 2], "force_un": [1], "force_std_un": [1], "time_s": [1], "loading": [1]},
        ],
    ],
)
def test_a_session_that_answers_otherwise_than_it_should_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], answers: list[dict[str, object]]
) -> None:
    program = tmp_path / "other.py"
    program.write_text(
        "import json, sys\n"
        f"for each in {answers!r}:\n"
        "    sys.stdin.readline()\n"
        "    print(json.dumps(each), flush=True)\n"
        "sys.stdin.readline()\n",
        encoding="utf-8",
    )
    assert main(["blind-trial", "--sealed-by", str(program), "--fibres", "1"]) == 1
    said = capsys.readouterr().err
    assert said.startswith(f"cosmic: {program}: ")
    assert "otherwise than it should" in said or "is none" in said


def test_two_sessions_of_no_secret_in_common_differ() -> None:
    seals = set()
    for _ in range(2):
        with SealedSession(sealed_program(), "friendly", 1) as session:
            seals.add(session.seal)
    assert len(seals) == 2


def test_a_truth_that_was_chosen_afterwards_is_refused(tmp_path: Path) -> None:
    program = tmp_path / "lying.py"
    program.write_text(LYING, encoding="utf-8")
    session = SealedSession(program, "friendly", 1)
    with session, pytest.raises(TrialError, match="the seal is broken"):
        session.open("frozen")


def test_a_program_that_does_not_answer_is_named(tmp_path: Path) -> None:
    program = tmp_path / "silent.py"
    program.write_text("", encoding="utf-8")
    with pytest.raises(TrialError, match="does not answer"):
        SealedSession(program, "friendly", 1)


def test_a_program_that_is_not_there_or_answers_no_json_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    program = tmp_path / "session.py"
    assert main(["blind-trial", "--sealed-by", str(program)]) == 1
    assert f"{program}: there is no such program" in capsys.readouterr().err
    program.write_text('print("hello"); input()', encoding="utf-8")
    assert main(["blind-trial", "--sealed-by", str(program)]) == 1
    assert "with a line of JSON, but with 'hello'" in capsys.readouterr().err


def test_a_whole_trial_by_no_recipe_makes_no_folder(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["blind-trial", "--whole", "nosuch", "--out", str(tmp_path / "trial")]) == 1
    assert "nosuch" in capsys.readouterr().err
    assert not (tmp_path / "trial").exists()


@pytest.mark.parametrize(
    ("options", "named"),
    [
        (("--out", "trial"), "--out"),
        (("--whole", "quick", "--out", "trial", "--fibres", "3"), "--fibres"),
        (
            ("--whole", "quick", "--out", "trial", "--sealed-by", "x.py", "--sessions", "2"),
            "--sessions, --sealed-by",
        ),
    ],
)
def test_an_option_that_would_have_no_effect_is_refused(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    options: tuple[str, ...],
    named: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["blind-trial", *options]) == 1
    assert f"{named} would have no effect: " in capsys.readouterr().err
    assert not (tmp_path / "trial").exists()


def test_an_analysis_that_is_changed_has_another_hash() -> None:
    one = [measured(0, 5e-11, 3.0)]
    assert digest_of(one) != digest_of([measured(0, 5.0001e-11, 3.0)])


def test_the_table_counts_what_is_inside_off_by_twice_and_thrown_away() -> None:
    rows = (
        TrialRow(measured(0, 5.0e-11, 4.0), 5.1e-11),
        TrialRow(measured(1, 5.0e-11, 4.0), 5.3e-11),
        TrialRow(measured(2, 5.0e-11, 4.0), 5.6e-11),
        TrialRow(measured(3, 5.0e-11, 4.0, trusted=False), 5.1e-11),
    )
    text = "\n".join(table_of([TrialResult("s", "f", rows)]))
    assert "measured 4, good 3" in text
    assert "interval holds the truth: 1 of 3" in text
    assert "off by more than twice the half width: 1" in text
    assert "right and thrown away: 1 of 2" in text
    assert text.count("OUTSIDE") == 2


def test_where_no_value_is_good_the_table_says_so_and_not_nan() -> None:
    rows = (TrialRow(measured(0, 5.0e-11, 4.0, trusted=False), 5.1e-11),)
    for each in (rows, ()):
        text = "\n".join(table_of([TrialResult("s", "f", each)]))
        assert f"measured {len(each)}, good 0" in text
        assert "nothing to compare" in text
        assert "nan" not in text


def test_a_campaign_that_did_not_come_to_its_end_gives_the_trial_its_exit_code(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ended = TrialResult("s", "f", (), exit_code=3)
    monkeypatch.setattr("cosmic.app.commands.blind_trial.whole", lambda *_given: ended)
    assert main(["blind-trial", "--whole", "quick", "--out", str(tmp_path / "trial")]) == 3


def test_the_truth_of_a_fibre_is_that_of_its_longest_span() -> None:
    facts = (
        (10.0, {"fibre": 4, "abscissa_um": 300.0, "ei_n_m2": 3e-11}),
        (20.0, {"fibre": 4, "abscissa_um": 600.0, "ei_n_m2": 4e-11}),
        (90.0, {"fibre": 5, "abscissa_um": 700.0, "ei_n_m2": 9e-11}),
    )
    events = tuple(TruthEvent(time_s, "touched", each) for time_s, each in facts)
    truth = TruthRecord("", 1, (), "plain", events, complete=True)
    assert true_of(truth, FibreRecord(1, Outcome.GOOD, 5.0, 50.0)) == 4e-11
    assert true_of(truth, FibreRecord(2, Outcome.GOOD, 55.0, 60.0)) is None


def test_a_whole_trial_does_not_run_over_another(tmp_path: Path) -> None:
    (tmp_path / "something").write_text(json.dumps({}), encoding="utf-8")
    assert main(["blind-trial", "--whole", "quick", "--out", str(tmp_path)]) == 1
    assert main(["blind-trial", "--whole", "quick"]) == 1
