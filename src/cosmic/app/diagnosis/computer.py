"""What the computer itself offers: Python, packages, windows, time, disk and permissions."""

import json
import os
import platform
import re
import statistics
import struct
import subprocess
import sys
from collections.abc import Iterator
from importlib import metadata
from itertools import pairwise
from pathlib import Path
from typing import Final

from cosmic.app.diagnosis.finding import Finding, State
from cosmic.frame.clock import WALL
from cosmic.frame.errors import NotAvailable
from cosmic.frame.file_names import check_directory, space_left
from cosmic.frame.platform_services import tick_finely
from cosmic.frame.version import __version__

NEWEST_TESTED: Final = (3, 13)
_WAIT_S: Final = 0.002
_WAITS: Final = 40
_LATE_S: Final = 0.005
_BLOCK: Final = bytes(1 << 20)
_BLOCKS: Final = 32
_SLOW_MB_S: Final = 20.0
_PROBE_S: Final = 30.0
_PRIORITY: Final = (
    "from cosmic.frame.platform_services import run_thread_first; print(run_thread_first(1))"
)
_REQUIREMENT: Final = re.compile(r"^([\w.-]+)[^;]*(?:;(.*))?$")
_EXTRA: Final = re.compile(r"""extra == ['"]([\w-]+)['"]""")


def python() -> Iterator[Finding]:
    """Look at the interpreter."""
    bits = struct.calcsize("P") * 8
    found = f"{platform.python_version()}, {bits} bit, {sys.executable}"
    advice = ""
    if bits != 64:
        advice = "Install a 64 bit Python: most packages and vendors' libraries have no other."
    elif sys.version_info[:2] > NEWEST_TESTED:
        advice = "CoSMic is tested up to Python {}.{}.".format(*NEWEST_TESTED)
    state = State.PROBLEM if bits != 64 else State.NOTE if advice else State.GOOD
    yield Finding("Python", "Python", state, found, advice)
    where = Path(__file__).resolve().parents[2]
    yield Finding("Python", "CoSMic", State.GOOD, f"{__version__}, {where}")


def packages() -> Iterator[Finding]:
    """Look for what CoSMic depends on, and for its extras."""
    extras: dict[str, list[str]] = {"": []}
    for line in metadata.requires("cosmic") or ():
        match = _REQUIREMENT.match(line)
        marker = (match[2] or "") if match else ""
        extra = _EXTRA.search(marker)
        if match is None or (marker and not extra):  # for another system
            continue
        group = extras.setdefault(extra[1] if extra else "", [])
        if match[1].lower() != "cosmic" and not _installed(match[1]):
            group.append(match[1])
    lacking = extras.pop("")
    yield Finding(
        "Packages",
        "needed",
        State.PROBLEM if lacking else State.GOOD,
        f"missing: {', '.join(lacking)}" if lacking else "all installed",
        f"pip install {' '.join(lacking)}" if lacking else "",
    )
    for name, absent in sorted(extras.items()):
        yield Finding(
            "Packages",
            f"extra {name}",
            State.NOTE if absent else State.GOOD,
            f"missing: {', '.join(absent)}" if absent else "installed",
            f'If you need it: pip install "cosmic[{name}]"' if absent else "",
        )


def _installed(name: str) -> bool:
    try:
        metadata.version(name)
    except metadata.PackageNotFoundError:
        return False
    return True


def windows() -> Iterator[Finding]:
    """Look whether windows can be shown, and who draws them."""
    environment = dict(os.environ)
    no_display = sys.platform == "linux" and not (
        environment.get("DISPLAY") or environment.get("WAYLAND_DISPLAY")
    )
    if no_display:
        environment.setdefault("QT_QPA_PLATFORM", "offscreen")
    probe = [sys.executable, "-m", "cosmic.app.diagnosis.window_probe"]
    ended = subprocess.run(
        probe, env=environment, capture_output=True, text=True, timeout=_PROBE_S, check=False
    )
    if ended.returncode != 0:
        said = ended.stderr.strip().splitlines() or [f"exit code {ended.returncode}"]
        advice = "Install the libraries of the system that Qt needs: ./run does, or names them."
        yield Finding("Windows", "Qt", State.PROBLEM, said[0], advice)
        return
    seen = json.loads(ended.stdout.splitlines()[-1])
    screens = ", ".join(seen["screens"]) or "no screen"
    advice = "No window opens without one; cosmic serve, campaign and --offscreen do." * no_display
    found = "no display" if no_display else f"{seen['platform']}, {screens}"
    yield Finding("Windows", "display", State.NOTE if no_display else State.GOOD, found, advice)
    opengl = seen["opengl"]
    if no_display and not opengl:  # what draws on a display cannot be asked without one
        return
    advice = "" if opengl else "The 3D view of the platform stays empty: install Mesa or a driver."
    state = State.GOOD if opengl else State.NOTE
    yield Finding("Windows", "OpenGL", state, opengl or "none", advice)


def clock() -> Iterator[Finding]:
    """Measure in which steps time moves, and how late waits end."""
    tick_finely()
    times_s = [WALL.now_s() for _ in range(5000)]
    steps_s = [later - now for now, later in pairwise(times_s) if later > now]
    late_s: list[float] = []
    for _ in range(_WAITS):
        begun_s = WALL.now_s()
        WALL.sleep(_WAIT_S)
        late_s.append(WALL.now_s() - begun_s - _WAIT_S)
    usual_s, worst_s = statistics.median(late_s), max(late_s)
    step_us = min(steps_s, default=0.0) * 1e6
    lateness = f"{usual_s * 1e3:.2f} ms late, {worst_s * 1e3:.1f} ms at worst"
    found = f"steps of {step_us:.2g} us; waits end {lateness}"
    late = usual_s > _LATE_S
    advice = "Control loops miss periods: close other programs, switch power saving off." * late
    yield Finding("Time", "clock", State.NOTE if late else State.GOOD, found, advice)


def disk(folder: Path) -> Iterator[Finding]:
    """Measure how fast recordings can be written; raises `CosmicError` where they cannot be."""
    whole = check_directory(folder)
    file = whole / f".cosmic-doctor-{os.getpid()}"
    try:
        begun_s = WALL.now_s()
        with file.open("wb") as opened:
            for _ in range(_BLOCKS):
                opened.write(_BLOCK)
            opened.flush()
            os.fsync(opened.fileno())
        speed_mb_s = _BLOCKS * len(_BLOCK) / 1e6 / (WALL.now_s() - begun_s)
    except OSError as exc:
        raise NotAvailable(f"{whole} cannot be written to: {exc.strerror or exc}") from exc
    finally:
        file.unlink(missing_ok=True)
    free_gb = space_left(whole, 0.0).free_bytes / 1e9
    slow = speed_mb_s < _SLOW_MB_S
    found = f"{whole}: {speed_mb_s:.0f} MB/s, {free_gb:.1f} GB free"
    advice = "Record to a faster disk: images need 20 MB/s and more." * slow
    yield Finding("Disk", "recordings", State.NOTE if slow else State.GOOD, found, advice)


def permissions() -> Iterator[Finding]:
    """Look whether a control loop may run before other programs."""
    asked = [sys.executable, "-c", _PRIORITY]
    ended = subprocess.run(asked, capture_output=True, text=True, timeout=_PROBE_S, check=False)
    reason = ended.stdout.strip() if ended.returncode == 0 else ended.stderr.strip()[-200:]
    advice = ""
    if reason and sys.platform == "linux":
        advice = "To allow it: a line '@USERS - rtprio 20' in /etc/security/limits.d/cosmic.conf."
    state = State.NOTE if reason else State.GOOD
    found = reason or "granted"
    yield Finding("Permissions", "real-time priority", state, found, advice)
