"""What the camera found of axes goes into the platform file, and nothing else of it changes."""

from pathlib import Path

import pytest

from cosmic.app.configuration.axes_seen import note_axes
from cosmic.autonomy.stage_check import AxisCheck, StageReport
from cosmic.frame.config import shipped_config_dir
from cosmic.frame.errors import ConfigError

LEFT_X = AxisCheck("left.x", -0.3, 7.5, repeatability_um=0.2741, backlash_um=-0.216, arrivals=16)
REPORT = StageReport("left", (LEFT_X,), angle_deg=89.1)
BEFORE = """\
[platform]
name = "Ours"  # ours

[mico]
backend = "simulated"

[[mico.positioner]]
name = "left.x"       # the first
limits_um = [-5.0, 5.0]

# The second one is slow.
[[mico.positioner]]
name = "left.y"
limits_um = [-5.0, 5.0]

# Force.
[daqco]
backend = "simulated"
"""
NOTED = """\
repeatability_um = 0.274 # seen by the camera, 2026-11-29
backlash_um = -0.216 # seen by the camera, 2026-11-29
"""


def noted(tmp_path: Path, text: str) -> str:
    path = tmp_path / "platform.toml"
    path.write_text(text, encoding="utf-8")
    note_axes(path, REPORT, "2026-11-29")
    return path.read_text(encoding="utf-8")


def test_numbers_are_noted_in_the_entry_of_their_axis(tmp_path: Path) -> None:
    first, rest = BEFORE.split("\n\n# The second")
    assert noted(tmp_path, BEFORE) == f"{first}\n{NOTED}\n# The second{rest}"


def test_numbers_of_before_are_replaced(tmp_path: Path) -> None:
    once = noted(tmp_path, BEFORE)
    older = once.replace("0.274 ", "0.9 ").replace("2026-11-29", "2025-01-01")
    assert noted(tmp_path, older) == once


def test_entries_in_one_line_are_noted_too(tmp_path: Path) -> None:
    text = '[mico]\npositioner = [{ name = "left.x", limits_um = [-5.0, 5.0] }]  # all\n'
    assert "repeatability_um = 0.274, backlash_um = -0.216" in noted(tmp_path, text)


def test_an_axis_without_entry_and_the_shipped_file_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"no entry for left\.x"):
        noted(tmp_path, BEFORE.replace("left.x", "left.w"))
    for text in ("[mico", "[platform]\n", "mico = 3\n"):
        with pytest.raises(ConfigError, match=r"platform\.toml"):
            noted(tmp_path, text)
    shipped = shipped_config_dir() / "platform.toml"
    with pytest.raises(ConfigError, match="ships with CoSMic"):
        note_axes(shipped, REPORT, "2026-11-29")
