"""Reading trajectories: what is understood, and what is refused with its line."""

import math
from pathlib import Path

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from cosmic.mico.core.trajectory import reader
from cosmic.mico.core.trajectory.model import Leg, Move, Speed, Steps, TrajectoryError, Wait
from cosmic.mico.core.trajectory.reader import parse
from cosmic.mico.core.trajectory.writer import to_text

HEAD = "cosmic-trajectory 1\nplatform FiberStation\n"


def problems(text: str | bytes) -> list[tuple[int, str]]:
    with pytest.raises(TrajectoryError) as caught:
        parse(text)
    return [(each.line, each.text) for each in caught.value.problems]


def only_problem(statement: str) -> str:
    """Return what is wrong with `statement` in line 3."""
    found = problems(HEAD + statement + "\n")
    assert [line for line, _ in found] == [3]
    return found[0][1]


def test_a_trajectory_written_by_hand_says_what_it_does() -> None:
    trajectory = parse(
        HEAD + "# over the fibre\n"
        "title Pick up\n"
        "relative to pose fibre: left.x, left.y\n"
        "start left.x 0 um, left.y 12.5um\n"
        "\n"
        "left.x to 0.2 mm\n"
        "    left.x by -5 µm   # back\n"
        "t = 3.5 s together\n"
        "    left.x to 10 um\n"
        "    steps left.gripper -100 100 V 1 kHz\n"
        "end\n"
        "wait 250 ms\n"
        "speed left.x 500 um/s\n"
        "table.rotation to 1500 mdeg\n"
    )
    assert trajectory.platform == "FiberStation"
    assert trajectory.title == "Pick up"
    assert trajectory.is_relative("left.x")
    assert not trajectory.is_relative("table.rotation")
    assert {axis: place.value for axis, place in trajectory.start.items()} == {
        "left.x": 0.0,
        "left.y": 12.5,
    }
    assert trajectory.statements == (
        Leg((Move("left.x", 200.0, "um", by=False, line=8),), 8),
        Leg((Move("left.x", -5.0, "um", by=True, line=9),), 9),
        Leg(
            (
                Move("left.x", 10.0, "um", by=False, line=11),
                Steps("left.gripper", -100, 100.0, 1000, 12),
            ),
            10,
            3.5,
        ),
        Wait(0.25, 14),
        Speed("left.x", 500.0, "um/s", 15),
        Leg((Move("table.rotation", 1.5, "deg", by=False, line=16),), 16),
    )
    assert trajectory.comments == ((3, "over the fibre"), (9, "back"))
    assert trajectory.axes == ("left.x", "left.gripper", "table.rotation")
    assert trajectory.timed


def test_what_is_written_reads_the_same_again() -> None:
    text = to_text(
        parse(HEAD + "# a\nleft.x to 1.25 um\nt=2 s wait 1 s\n# b\nsteps left.gripper 5\n# c\n")
    )
    assert to_text(parse(text)) == text
    assert [line for line in text.splitlines() if line.startswith("#")] == ["# a", "# b", "# c"]


@pytest.mark.parametrize(
    ("statement", "words"),
    [
        ("left.x to 12.5", "has no unit"),
        ("left.x to nan um", "not a number"),
        ("left.x to inf um", "not a number"),
        ("left.x to 1e999 um", "too large"),
        ("left.x to 1,5 um", "point"),
        ("left.x to 5 N", "not a unit of a position"),
        ("left.x to", "missing"),
        ("left.x goto 5 um", "not understood"),
        ("Left.X to 5 um", "not a name of an axis"),
        ("left.x.y to 5 um", "not a name of an axis"),
        ("wait", "not a time"),
        ("wait -1 s", "not a time"),
        ("wait 2e9 s", "not a time"),
        ("wait 90000 s", "not a time"),
        ("steps left.gripper", "steps left.gripper -100"),
        ("steps left.gripper 1.5", "whole number"),
        ("steps left.gripper 9999999999", "whole number"),
        ("steps left.gripper 10 100 um", "steps left.gripper -100"),
        ("steps left.gripper 10 100 V 1.5 Hz", "whole number of Hz"),
        ("speed left.x 0 um/s", "above 0"),
        ("speed left.x nan Hz", "not a number"),
        ("relative to fibre", "relative to pose NAME"),
        ("end", "none open"),
        ("t=x s left.x to 5 um", "not a time"),
        ("platform Other", "already"),
        ("left.x to 5 um\x00", "cannot be printed"),
        ("left.x to 5 um" + " " * 600, "more than 500"),
    ],
)
def test_a_line_that_is_wrong_is_reported_with_its_number(statement: str, words: str) -> None:
    assert words in only_problem(statement)


@pytest.mark.parametrize(
    ("text", "line", "words"),
    [
        ("", 1, "empty"),
        ("<html>\n" * 50, 1, "not a trajectory"),
        ("cosmic-trajectory\n", 1, "not a trajectory"),
        ("cosmic-trajectory 2\nplatform x\n", 1, "version 2"),
        ("cosmic-trajectory 1\nleft.x to 5 um\n", 1, "platform NAME"),
        (HEAD + "together\nleft.x to 5 um\n", 4, "no end"),
        (HEAD + "together\nend\n", 4, "empty"),
        (HEAD + "together\nwait 1 s\nend\n", 4, "'end' missing"),
        (HEAD + "together\nleft.x to 1 um\nleft.x to 2 um\nend\n", 5, "line 4"),
        (HEAD + "t=2 s wait 1 s\nt=1 s wait 1 s\n", 4, "earlier"),
        (HEAD + "left.x to 5 um\nstart left.x 0 um\n", 4, "moves before"),
        (HEAD + "left.x to 5 um\ntitle late\n", 4, "before the first"),
        (HEAD + "recorded today\nleft.x to 5 um\n", 4, "cut off"),
        (HEAD + "end of recording\nleft.x to 5 um\n", 4, "comes after"),
        (HEAD.encode() + b"left.x to 5 \xb5m\n", 3, "UTF-8"),
        (HEAD.encode("utf-16"), 1, "UTF-8"),
    ],
)
def test_a_file_that_is_wrong_is_refused_at_its_line(
    text: str | bytes, line: int, words: str
) -> None:
    assert (line, True) in [(at, words in said) for at, said in problems(text)]


def test_all_mistakes_are_reported_at_once() -> None:
    found = problems(HEAD + "left.x to 5\nleft.y to 1 um\nwait\n")
    assert [line for line, _ in found] == [3, 5]


def test_a_foreign_file_of_many_lines_is_reported_in_one() -> None:
    assert len(problems("nonsense\n" * 10_000)) == 1
    assert len(problems(HEAD + "nonsense\n" * 10_000)) < 300


def test_a_recording_that_is_cut_off_can_be_taken_on_purpose() -> None:
    text = HEAD + "recorded today\nleft.x to 5 um\n"
    assert parse(text, cut_off=True).axes == ("left.x",)
    assert parse(text + "end of recording\n").axes == ("left.x",)


@pytest.mark.parametrize("cut", range(1, 40, 3))
def test_a_recording_cut_anywhere_is_refused(cut: int) -> None:
    whole = HEAD + "recorded today\nleft.x to 120.5 um\nleft.y to 3 um\nend of recording\n"
    problems(whole[: -cut - 1])


def test_a_file_that_is_missing_or_huge_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(TrajectoryError, match="cannot be read"):
        reader.load(tmp_path / "none.trajectory")
    with pytest.raises(TrajectoryError, match="cannot be read"):
        reader.load(tmp_path)
    monkeypatch.setattr(reader, "LARGEST_BYTES", 1000)
    monkeypatch.setattr(reader, "MOST_LINES", 50)
    (tmp_path / "huge").write_bytes(b"#" * 2000)
    with pytest.raises(TrajectoryError, match="larger than"):
        reader.load(tmp_path / "huge")
    (tmp_path / "long").write_text("\n" * 100, encoding="utf-8")
    with pytest.raises(TrajectoryError, match="100 lines"):
        reader.load(tmp_path / "long")


def test_reading_reports_how_far_it_is() -> None:
    fractions: list[float] = []
    parse(HEAD + "left.x to 1 um\n" * 2000, progress=fractions.append)
    assert fractions == sorted(fractions)
    assert len(fractions) >= 3
    assert 0.0 < fractions[0] <= fractions[-1] <= 1.0


words = st.sampled_from(
    ["left.x", "to", "by", "12.5 um", "-1e308 mm", "nan", "together", "end", "wait", "0.5 s",
     "t=1 s", "steps", "speed", "relative to pose", "start", ",", "#", "platform", "µm", "100 V",
     "1 kHz", "\x00", "\u2028", "end of recording", "²", "\ufeff", "9" * 400]
)  # fmt: skip
lines = st.lists(st.lists(words | st.text(max_size=8), max_size=6).map(" ".join), max_size=8)


@settings(max_examples=60)
@given(lines)
@example(["together", "end of recording"])
@example(["t=1 s t=1 s wait 1 s"])
def test_no_text_does_anything_but_be_read_or_refused(some: list[str]) -> None:
    text = HEAD + "\n".join(some)
    try:
        found = parse(text)
    except TrajectoryError as exc:
        assert all(each.line >= 1 for each in exc.problems)
        return
    assert to_text(parse(to_text(found))) == to_text(found)
    moves = [part for each in found.statements if isinstance(each, Leg) for part in each.parts]
    assert all(math.isfinite(each.value) for each in moves if isinstance(each, Move))


@settings(max_examples=40)
@given(st.binary(max_size=60))
def test_no_bytes_do_anything_but_be_read_or_refused(data: bytes) -> None:
    for text in (data, HEAD.encode() + data):
        try:
            parse(text)
        except TrajectoryError as exc:
            assert exc.problems


def test_a_platform_may_have_any_name_that_its_file_may_give_it() -> None:
    name = "Lab 3, east: fibres"
    found = parse(f"cosmic-trajectory 1\nplatform {name}\nleft.x to 5 um\n")
    assert found.platform == name
    assert parse(to_text(found)).platform == name
