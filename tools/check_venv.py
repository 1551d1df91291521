"""Say by the exit code whether an environment still fits; run with its own Python.

tools/setup.cmd asks it `place` (was it made for the folder it is in, and has it pip?) and
`packages` (is what CoSMic starts with installed?), as tools/setup.sh asks a shell.
"""

import os
import sys
from importlib.util import find_spec
from pathlib import Path

PACKAGES = ("cosmic", "PySide6", "numpy", "pydantic")


def fits_place(prefix: str) -> bool:
    """Whether the environment was made where it is: launchers in it name that place."""
    settings = (Path(prefix) / "pyvenv.cfg").read_text(encoding="utf-8")
    pairs = (line.partition("=") for line in settings.splitlines())
    made = next((value for key, _, value in pairs if key.strip() == "command"), "")
    return os.path.normcase(made).rstrip().endswith(f" {os.path.normcase(prefix)}")


def main(question: str) -> int:
    """Answer one of the two questions: 0 for yes."""
    if question == "packages":
        return int(not all(map(find_spec, PACKAGES)))
    return int(find_spec("pip") is None or not fits_place(sys.prefix))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
