"""What every test lives under: nothing on the screen, nothing left over, nothing unseen."""

import atexit
import gc
import logging
import os
import shutil
import sys
import tempfile
import threading
import tomllib
from collections.abc import Generator, Iterator
from importlib import metadata
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings

from cosmic.frame.threads import running_threads

# A simulated platform is the plain twin unless a test names a world, in this process and in others.
os.environ["COSMIC_WORLD"] = "plain"
if "COSMIC_TEST_DISPLAY" not in os.environ:
    os.environ["QT_QPA_PLATFORM"] = "offscreen"

pytest_plugins = ["pytester"]

settings.register_profile("cosmic", deadline=None, derandomize=True)
settings.load_profile("cosmic")

# Qt keeps these for itself and ends them by its own timers.
QT_OWN_WINDOWS = {"QTipLabel", "QWhatsThat", "QShapedPixmapWidget"}
FAILED = pytest.StashKey[bool]()
# Set where everything that tests skip without was installed: a skip is then a defect.
NOTHING_MISSING = "COSMIC_TEST_NOTHING_MISSING" in os.environ


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--hardware", action="store_true", help="also run the tests that move the real rig"
    )


def pytest_configure(config: pytest.Config) -> None:
    _announce_entry_points()
    config.addinivalue_line(
        "markers", "defects: the test provokes a defect, which the failure policy then logs"
    )


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers() -> int | None:
    """Return how many files are tested side by side with `-n auto`: one more than there are cores.

    A third of the time a test waits for what it has begun.
    """
    if "PYTEST_XDIST_AUTO_NUM_WORKERS" in os.environ:
        return None  # somebody says it
    return (os.cpu_count() or 1) + 1


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Generator[None, object, object]:
    """Import all tests without looking, a dozen times, through what was imported for garbage."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.enable()


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    skip = pytest.mark.skip(reason="needs the real rig: pytest --hardware")
    for item in items:
        marker = item.get_closest_marker("hardware")
        if marker is None:
            continue
        if not (marker.args or marker.kwargs.get("moves")):
            raise pytest.UsageError(
                f"{item.nodeid}: say the most that the test may move or switch: "
                '@pytest.mark.hardware(moves="left.x, 10 um")'
            )
        if not config.getoption("--hardware"):
            item.add_marker(skip)
    if hasattr(config, "workerinput"):
        # Side by side: a file of few and long tests that is begun last holds up the end.
        items.sort(key=lambda item: "system" not in item.path.parts)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    report = yield
    hardware = item.get_closest_marker("hardware") is not None
    if report.skipped and NOTHING_MISSING and not hardware and not hasattr(report, "wasxfail"):
        reason = report.longrepr[2] if isinstance(report.longrepr, tuple) else ""
        report.outcome = "failed"
        report.longrepr = f"skipped, where nothing is missing: {reason}"
    if report.failed:
        item.stash[FAILED] = True
    return report


def _announce_entry_points() -> None:
    """Have the entry points of this tree found where it was installed before it had them all."""
    root = Path(__file__).resolve().parents[1]
    if not (root / "pyproject.toml").is_file():
        return  # a copy of this file, for a test of itself
    project = tomllib.loads((root / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    groups = project["entry-points"]
    there = metadata.distribution("cosmic")
    installed = {(each.group, each.name, each.value) for each in there.entry_points}
    if all((group, *each) in installed for group in groups for each in groups[group].items()):
        return
    folder = Path(tempfile.mkdtemp(prefix="cosmic-entry-points-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    described = folder / f"cosmic-{there.version}.dist-info"
    described.mkdir()
    (described / "METADATA").write_text(f"Name: cosmic\nVersion: {there.version}\n")
    lines = [
        line
        for group, entries in groups.items()
        for line in (f"[{group}]", *(f"{name} = {value}" for name, value in entries.items()))
    ]
    (described / "entry_points.txt").write_text("\n".join(lines) + "\n", encoding="utf-8")
    sys.path.insert(0, str(folder))
    inherited = os.environ.get("PYTHONPATH", "")
    os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, (str(folder), inherited)))


@pytest.fixture(autouse=True)
def _own_settings(
    tmp_path_factory: pytest.TempPathFactory, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Give each test settings of its own, in this process and in those it starts."""
    folder = tmp_path_factory.getbasetemp() / "settings" / f"{next(_numbers)}"
    for variable in ("XDG_CONFIG_HOME", "XDG_DATA_HOME", "XDG_STATE_HOME"):
        monkeypatch.setenv(variable, str(folder))
    core = sys.modules.get("PySide6.QtCore")
    if core is not None:
        kinds = core.QSettings
        kinds.setDefaultFormat(kinds.Format.IniFormat)
        for form in (kinds.Format.IniFormat, kinds.Format.NativeFormat):
            kinds.setPath(form, kinds.Scope.UserScope, str(folder))


_numbers = iter(range(sys.maxsize))


@pytest.fixture(autouse=True)
def _nothing_left_over(request: pytest.FixtureRequest) -> Iterator[None]:
    """Fail a test that leaves a thread, a window or a process-wide hook behind.

    What fixtures of a wider scope made before the test is theirs, and stays.
    """
    threads_before = set(threading.enumerate())
    workers_before = {id(worker) for worker in running_threads()}
    windows_before = set(_windows())
    hooks_before = (sys.excepthook, threading.excepthook, sys.unraisablehook)
    yield
    left = [
        *_end_workers(workers_before),
        *_name_threads(threads_before),
        *_close_windows(windows_before),
        *_restore_hooks(hooks_before),
    ]
    # The traceback of a failed test keeps its widgets alive: say the failure, not its shadow.
    if left and not request.node.stash.get(FAILED, False):
        pytest.fail("the test left behind: " + "; ".join(left), pytrace=False)


def _end_workers(before: set[int]) -> list[str]:
    left = [worker for worker in running_threads() if id(worker) not in before]
    for worker in left:
        worker.request_end()
        worker.join()
    return [f"running worker thread {worker.name!r}" for worker in left]


def _name_threads(before: set[threading.Thread]) -> list[str]:
    left = [each for each in threading.enumerate() if each not in before and not each.daemon]
    for thread in left:
        thread.join(1.0)
    return [f"thread {thread.name!r}" for thread in left]


def _windows() -> dict[int, Any]:
    """Return the top-level widgets there are, by their address."""
    widgets = sys.modules.get("PySide6.QtWidgets")
    if widgets is None or widgets.QApplication.instance() is None:
        return {}
    import shiboken6

    return {
        shiboken6.getCppPointer(widget)[0]: widget
        for widget in widgets.QApplication.topLevelWidgets()
        if widget.parentWidget() is None and widget.metaObject().className() not in QT_OWN_WINDOWS
    }


def _close_windows(before: set[int]) -> list[str]:
    if not set(_windows()) - before:
        return []
    core: Any = sys.modules["PySide6.QtCore"]
    delete = core.QEvent.Type.DeferredDelete.value
    core.QCoreApplication.sendPostedEvents(None, delete)
    if set(_windows()) - before:  # a collection costs more than most tests
        gc.collect()
    left = [widget for address, widget in _windows().items() if address not in before]
    names = [f"window {type(widget).__name__} {widget.windowTitle()!r}" for widget in left]
    for widget in left:
        widget.hide()
        widget.deleteLater()
    core.QCoreApplication.sendPostedEvents(None, delete)
    return names


def _restore_hooks(before: tuple[Any, Any, Any]) -> list[str]:
    if (sys.excepthook, threading.excepthook, sys.unraisablehook) == before:
        return []
    sys.excepthook, threading.excepthook, sys.unraisablehook = before
    return ["exception hooks of the process (call what install_hooks returned)"]


class _Defects(logging.Handler):
    """Remembers the defects that the failure policy logged."""

    def __init__(self) -> None:
        super().__init__(logging.ERROR)
        self.seen: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        if record.exc_info:
            self.seen.append(record.getMessage())


@pytest.fixture(autouse=True)
def _no_defect_unseen(request: pytest.FixtureRequest) -> Iterator[None]:
    """Fail a test during which a defect reached a failure policy, unless that is its point.

    A worker thread, a guarded callback and the hooks end an exception in the policy, so that
    nothing else would tell the test of it.
    """
    handler = _Defects()
    logger = logging.getLogger("cosmic.frame.failure")
    logger.addHandler(handler)
    yield
    logger.removeHandler(handler)
    expected = request.node.get_closest_marker("defects") is not None
    if handler.seen and not expected and not request.node.stash.get(FAILED, False):
        pytest.fail(
            "a defect was reported (if that is the point, mark the test with "
            "pytest.mark.defects): " + "; ".join(handler.seen),
            pytrace=False,
        )


@pytest.fixture(scope="session")
def repository() -> Path:
    """The folder with pyproject.toml."""
    return Path(__file__).resolve().parents[1]
