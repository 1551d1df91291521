"""Who catches everything hands it on: Ctrl+C and the end of the interpreter are not kept."""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

import cosmic

SOURCES = Path(cosmic.__file__).parent
KEPT = {
    "frame/threads.py": "the end of a thread, which tells the failure policy",
    "daqco/hw/labjack_board.py": "a thread of LJM, where it would be lost: the run ends with it",
    "daqco/hw/nidaqmx_task.py": "a thread of NI-DAQmx, where it would be lost; the run ends",
}


def swallowers(source: str) -> Iterator[int]:
    """Yield the lines of handlers of `BaseException` that do not end by raising."""
    for node in ast.walk(ast.parse(source)):
        if not isinstance(node, ast.ExceptHandler):
            continue
        names = {each.id for each in ast.walk(node.type or ast.Name("BaseException"))
                 if isinstance(each, ast.Name)}  # fmt: skip
        if "BaseException" in names and not isinstance(node.body[-1], ast.Raise):
            yield node.lineno


def test_who_catches_everything_raises_it_again() -> None:
    found = {
        path.relative_to(SOURCES).as_posix()
        for path in sorted(SOURCES.rglob("*.py"))
        if any(swallowers(path.read_text(encoding="utf-8")))
    }
    assert found == set(KEPT), "raise it again, or say here why it must end there"


@pytest.mark.parametrize(
    ("handler", "lines"),
    [
        ("except BaseException:\n    raise\n", []),
        ("except BaseException as exc:\n    note(exc)\n", [3]),
        ("except:\n    pass\n", [3]),
        ("except (ValueError, BaseException):\n    pass\n", [3]),
        ("except ValueError:\n    pass\n", []),
    ],
)
def test_a_handler_that_keeps_everything_is_found(handler: str, lines: list[int]) -> None:
    assert list(swallowers(f"try:\n    x()\n{handler}")) == lines
