"""The benchmarks still run; what they measure here says nothing."""

import importlib
import subprocess
import sys

import pytest


def quick(repository, *names):
    """Run benchmarks with a few samples each in a process of its own, as an operator does."""
    command = [sys.executable, "-m", "benchmarks.run", "--quick", "--only", *names]
    done = subprocess.run(
        command, cwd=repository, capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_a_quick_run_tells_every_figure_with_its_target(repository):
    lines = quick(repository, "commander", "simulator").splitlines()
    assert any("call without gate, p50 to bare" in line and "<= 3" in line for line in lines)
    assert any("SA_Stop_A" in line for line in lines)


def test_every_benchmark_offers_the_same_command(repository, monkeypatch):
    monkeypatch.setenv("QT_LOGGING_RULES", "")  # else they silence Qt for the tests that follow
    monkeypatch.syspath_prepend(repository)
    for name in importlib.import_module("benchmarks.run").ALL:
        assert callable(importlib.import_module(f"benchmarks.{name}").measure), name


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        "stop",
        "completion",
        "load",
        "start",
        "soak",
        "twin_picture",
        "live_view",
        "picture_recorder",
        "aravis_camera",
        "fibres",
        "vision_tools",
    ],
)
def test_each_benchmark_runs_quickly(repository, name):
    assert f"| {name} |" in quick(repository, name)
