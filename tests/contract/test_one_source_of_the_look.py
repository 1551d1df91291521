"""Style sheets and colours are written in the theme, nowhere else."""

import re
from pathlib import Path

import cosmic

SOURCES = Path(cosmic.__file__).parent
THEME = {"theme.py", "palette.py", "stylesheet.py"}
LOOKS = re.compile(r"\.setStyleSheet\(|[\"']#(?:[0-9A-Fa-f]{3,4}){1,2}[\"']|QColor\(\s*\d")


def test_no_widget_brings_its_own_style_sheet_or_colour() -> None:
    found = [
        f"{path.relative_to(SOURCES)}:{number}"
        for folder in ("app", "frame/gui", "mico/gui", "daqco/gui", "vico/gui")
        for path in sorted((SOURCES / folder).rglob("*.py"))
        if not (path.parent.name == "gui" and path.name in THEME)
        for number, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1)
        if LOOKS.search(line)
    ]
    assert found == []
