"""Recorded procedures as files: what is written is read again, and runs as Python."""

import runpy
from pathlib import Path
from unittest.mock import patch

import pytest

from cosmic.autonomy.recorded.steps import (
    GripperStep,
    LensStep,
    LightStep,
    MoveStep,
    OperationStep,
    PauseStep,
    RecordedProcedure,
    RecordStep,
    WaitForForceStep,
    WaitForOperatorStep,
    load_recorded,
)
from cosmic.autonomy.shipped.single_operation import SingleOperation
from cosmic.frame.errors import ConfigError

EVERYTHING = RecordedProcedure(
    name="pick and bend",
    step=[
        OperationStep(operation=SingleOperation.TAKE, gripper="left"),
        MoveStep(tool="left", point_um=(10.0, -20.0, 400.0), relative_to="fibre"),
        MoveStep(axes={"table.rotation": 30.0}),
        GripperStep(tool="left", opening_um=120.0),
        LensStep(zoom=0.58),
        LightStep(percent=40.0),
        RecordStep(name="bend"),
        OperationStep(operation=SingleOperation.PUSH, force_un=50.0, ask={"force_un": "Force, µN"}),
        WaitForForceStep(force_un=20.0),
        WaitForOperatorStep(kind="wait for mark", text="mark the end"),
        PauseStep(seconds=0.5),
        RecordStep(),
    ],
)


def test_what_is_saved_is_read_again_and_can_be_read_by_a_person(tmp_path: Path) -> None:
    file = tmp_path / "pick.toml"
    EVERYTHING.save(file)
    assert load_recorded(file) == EVERYTHING
    text = file.read_text("utf-8")
    assert 'operation = "take"' in text
    assert 'relative_to = "fibre"' in text


def test_the_file_says_nothing_that_means_nothing(tmp_path: Path) -> None:
    steps = [
        OperationStep(operation=SingleOperation.TAKE, gripper="left"),
        OperationStep(operation=SingleOperation.PUSH),
        MoveStep(axes={"left.x": 5.0}),
    ]
    file = tmp_path / "short.toml"
    RecordedProcedure(name="short", step=steps).save(file)
    assert file.read_text("utf-8").split("\n") == [
        'name = "short"',
        "",
        "[[step]]",
        'kind = "operation"',
        'operation = "take"',
        'gripper = "left"',
        "",
        "[[step]]",
        'kind = "operation"',
        'operation = "push"',
        "force_un = 50.0",
        "",
        "[[step]]",
        'kind = "move"',
        "",
        "[step.axes]",
        '"left.x" = 5.0',
        "",
    ]


def test_numbers_are_those_that_an_operation_uses_and_counts_stay_whole() -> None:
    assert not OperationStep(operation=SingleOperation.TAKE, gripper="left").numbers
    assert OperationStep(operation=SingleOperation.PUSH).numbers == {"force_un": 50.0}
    lens = LensStep(focus_counts=4000, ask={"focus_counts": "Focus"})
    procedure = RecordedProcedure(name="focus", step=[lens])
    assert procedure.with_values({(0, "focus_counts"): 3900.0}).step[0].words == (
        "Lens: focus 3900 counts"
    )
    with pytest.raises(ConfigError, match="focus_counts"):
        procedure.with_values({(0, "focus_counts"): 3900.5})


def test_the_script_holds_the_same_procedure_and_begins_nothing_when_imported(
    tmp_path: Path,
) -> None:
    file = tmp_path / "pick.py"
    EVERYTHING.save_python(file)
    names = runpy.run_path(str(file))
    assert names["PROCEDURE"] == EVERYTHING
    assert "# Push to 50 µN" in file.read_text("utf-8")


def test_the_script_asks_the_operator_and_names_the_platform(tmp_path: Path) -> None:
    file, config = tmp_path / "wait.py", tmp_path / "lab" / "platform.toml"
    procedure = RecordedProcedure(name="wait", step=[WaitForOperatorStep(text="look")])
    procedure.save_python(file, config)
    names = runpy.run_path(str(file))
    with patch("builtins.input", side_effect=["", "no"]) as asked:
        assert names["ask"]("Wait for key: look")
        assert not names["ask"]("Wait for key: look")
    assert "Wait for key: look" in asked.call_args.args[0]
    text = file.read_text("utf-8")
    assert f"cosmic.connect({str(config)!r})" in text
    assert "confirm=ask" in text
    RecordedProcedure(name="bright", step=[LightStep(percent=40.0)]).save_python(file)
    text = file.read_text("utf-8")
    assert "cosmic.connect()" in text
    assert "rig.replay(PROCEDURE).run_here()" in text


@pytest.mark.parametrize("name", ["C:\\new\\users", 'the """best"""', "two\nlines", '"µ"', "end\\"])
def test_the_script_is_python_whatever_the_procedure_and_its_steps_are_called(
    name: str, tmp_path: Path
) -> None:
    wait = WaitForOperatorStep(text="look at the tip\nthen go on")
    procedure = RecordedProcedure(name=name, step=[wait])
    procedure.save_python(tmp_path / "odd.py")
    assert runpy.run_path(str(tmp_path / "odd.py"))["PROCEDURE"] == procedure


def test_a_replay_asks_for_what_is_marked_and_takes_other_values() -> None:
    assert EVERYTHING.asked == {(7, "force_un"): ("Force, µN", 50.0)}
    assert EVERYTHING.with_values({(7, "force_un"): 20.0}).given == (("step 8, force", "20 µN"),)
    changed = EVERYTHING.with_values({(7, "force_un"): 30.0})
    assert changed.step[7].words == "Push to 30 µN"
    with pytest.raises(ConfigError, match="force_un"):
        EVERYTHING.with_values({(7, "force_un"): -1.0})
    assert EVERYTHING.needs_fibre


@pytest.mark.parametrize(
    ("text", "why"),
    [
        ('name = "a"\n[[step]]\nkind = "dance"\n', "kind|tag"),
        ('name = "a"\n[[step]]\nkind = "pause"\nseconds = -1\n', "seconds"),
        ('name = "a"\n[[step]]\nkind = "pause"\nseconds = 1\nhops = 2\n', "hops"),
        ("name = ", "Invalid value"),
        ("name = 2026-01-01", "date"),
        (f"name = {'[' * 3000}{']' * 3000}", "too deep"),
        (f"{'.'.join('a' * 3000)} = 1", "too deep"),
        (
            'name = "a"\n[[step]]\nkind = "record"\nname = "r"\nask = {name = "x"}\n',
            "'name' is not a num",
        ),
        (
            'name = "a"\n[[step]]\nkind = "pause"\nseconds = 1.0\nask = {hops = "x"}\n',
            "'hops' is no",
        ),
    ],
)
def test_a_damaged_file_names_the_key(text: str, why: str, tmp_path: Path) -> None:
    file = tmp_path / "bad.toml"
    file.write_text(text, "utf-8")
    with pytest.raises(ConfigError, match=why):
        load_recorded(file)
