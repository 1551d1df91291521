"""Install the extras that have a wheel on this computer, and say which have not.

Called by tools/setup.sh and tools/setup.cmd with the Python of the environment.
"""

import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
NOT_FOR_USERS = ("dev", "docs")
ASKED_FOR = {"pi": "installing it accepts PI's licence"}


def install(extras: list[str]) -> bool:
    """Install CoSMic with these extras at the pinned versions; False where pip fails."""
    command = [sys.executable, "-m", "pip", "install", "--quiet", "--no-input"]
    command += ["--disable-pip-version-check", "--only-binary", ":all:"]
    command += ["--constraint", str(ROOT / "constraints.txt")]
    command += ["--editable", f"{ROOT}[{','.join(extras)}]"]
    return subprocess.run(command, stderr=subprocess.DEVNULL, check=False).returncode == 0


def main() -> int:
    """Install all at once, or what can be had one by one; missing extras are no failure."""
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    every = tomllib.loads(text)["project"]["optional-dependencies"]
    wanted = [name for name in every if name not in (*NOT_FOR_USERS, *ASKED_FOR)]
    without = [] if install(wanted) else [name for name in wanted if not install([name])]
    lines = []
    if without:
        lines.append(f"Not installed, for want of wheels for this computer: {', '.join(without)}.")
    lines += [f"Not installed: {name}, because {why}." for name, why in ASKED_FOR.items()]
    lines.append(f"CoSMic runs without; to have one: {sys.executable} -m pip install cosmic[NAME]")
    sys.stderr.write("\n".join(lines) + "\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
