"""The benchmarks still run; what they measure here says nothing."""

import importlib
import re
import subprocess
import sys

import pytest
from benchmarks.run import ALL

from contract.cameras.gige_process import missing

LONGEST_S = {"campaign": 240.0, "campaign_day": 280.0, "campaign_worlds": 240.0}


def quick(repository, *names):
    """Run benchmarks with a few samples each in a process of its own, as an operator does."""
    command = [sys.executable, "-m", "benchmarks.run", "--quick", "--only", *names]
    longest_s = max(LONGEST_S.get(name, 110.0) for name in names)
    done = subprocess.run(
        command, cwd=repository, capture_output=True, text=True, timeout=longest_s, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_a_quick_run_reports_every_figure_with_its_target(repository):
    lines = quick(repository, "commander", "simulator").splitlines()
    assert any("call without gate, p50 to bare" in line and "<= 3" in line for line in lines)
    assert any("SA_Stop_A" in line for line in lines)


def test_no_benchmark_in_the_folder_is_forgotten(repository):
    """What measures and can be started is a benchmark, or the child of one."""
    commands = {
        file.stem
        for file in (repository / "benchmarks").glob("*.py")
        if '__name__ == "__main__"' in (text := file.read_text(encoding="utf-8"))
        and "def measure(" in text
    }
    assert {name for name in commands if not name.endswith("_child")} == set(ALL)


def test_every_benchmark_offers_the_same_command(repository, monkeypatch):
    monkeypatch.setenv("QT_LOGGING_RULES", "")  # else they silence Qt for the tests that follow
    monkeypatch.syspath_prepend(repository)
    for name in importlib.import_module("benchmarks.run").ALL:
        assert callable(importlib.import_module(f"benchmarks.{name}").measure), name


def sections(repository):
    """Return the sections of the page of figures by their titles."""
    page = (repository / "docs" / "reference" / "benchmarks.md").read_text(encoding="utf-8")
    _, *parts = re.split(r"^## (.*)$", page, flags=re.MULTILINE)
    return dict(zip(parts[::2], parts[1::2], strict=True))


def test_each_section_of_figures_names_commands_that_exist_and_when_it_was_measured(repository):
    for title, text in sections(repository).items():
        commands = re.findall(r"python -m benchmarks\.(\w+)([^`\n#]*)", text)
        assert commands, f"{title}: with which command?"
        for name, options in commands:
            assert name in {*ALL, "run", "guard"}, f"{title}: there is no benchmark {name}"
            sources = [repository / "benchmarks" / f"{each}.py" for each in (name, "figures")]
            offered = "".join(each.read_text(encoding="utf-8") for each in sources)
            for option in re.findall(r"--[\w-]+", options):
                assert f'"{option}"' in offered, f"{title}: {name} has no {option}"
        if "\n|" in text:
            assert re.search(r"\b20\d\d-\d\d-\d\d\b", text), f"{title}: when?"
            assert re.search(r"`[0-9a-f]{7,12}`", text), f"{title}: with which commit?"


def test_every_benchmark_is_among_the_figures(repository):
    all_pages = "".join(sections(repository).values())
    missing = [name for name in ALL if f"benchmarks.{name}" not in all_pages]
    assert missing == []


@pytest.mark.slow
@pytest.mark.timeout(300)
@pytest.mark.parametrize("name", ALL)
def test_each_benchmark_runs_quickly(repository, name):
    if name == "aravis_camera" and missing():
        pytest.skip(missing())
    rows = [line for line in quick(repository, name).splitlines() if line.startswith("| ")]
    assert len(rows) > 1, "it found nothing"
