"""What holds for the whole repository: quiet imports, honest documents, running examples."""

import ast
import json
import os
import re
import shlex
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from contextlib import suppress
from functools import cache
from importlib import metadata
from pathlib import Path

import pytest
from PySide6.QtCore import QObject, Signal

from system.docs_blocks import blocks

ROOT = Path(__file__).resolve().parents[2]
SOURCE = ROOT / "src"
DOCUMENTS = sorted([ROOT / "README.md", *(ROOT / "docs").rglob("*.md")])
_LOOKED_AT = (ROOT / "tests" / "system" / "test_examples.py").read_text(encoding="utf-8")
# Those whose words are looked at run there.
EXAMPLES = [
    each for each in sorted((ROOT / "examples").glob("*.py")) if f'"{each.name}"' not in _LOOKED_AT
]


def _modules() -> list[str]:
    files = sorted((SOURCE / "cosmic").rglob("*.py"))
    names = [".".join(file.relative_to(SOURCE).with_suffix("").parts) for file in files]
    return [name.removesuffix(".__init__") for name in names]


def _has_widgets(module: str) -> bool:
    return ".gui" in module or module.startswith("cosmic.app")


# --- imports ----------------------------------------------------------------------------------

WATCHED_IMPORT = """
import importlib, json, sys

SILENT = {"socket.connect", "socket.bind", "subprocess.Popen", "_thread.start_new_thread"}
root, groups, seen, current = sys.argv[1], json.loads(sys.argv[2]), [], ""

def watch(event, args):
    if event in SILENT:
        seen.append(f"{current}: {event}")
    elif event == "open" and isinstance(args[0], str):
        code = args[0].endswith((".py", ".pyc"))
        if args[1] not in (None, "r", "rb") or (args[0].startswith(root) and not code):
            seen.append(f"{current}: opened {args[0]}")

import ctypes, h5py, logging, numpy, pydantic.fields  # what they do is their affair
import PySide6.QtCore  # after pydantic: its import hook trips over pydantic's lazy modules
sys.addaudithook(watch)
first_with_widgets = {}
for group, modules in groups.items():
    for current in modules:
        importlib.import_module(current)
        loaded = {"PySide6.QtWidgets", "PySide6.QtGui", "pyqtgraph"} & set(sys.modules)
        if loaded and group not in first_with_widgets:
            first_with_widgets[group] = f"{current} loads {loaded}"
current = "afterwards"
if PySide6.QtCore.QCoreApplication.instance() is not None:
    seen.append("there is an application object")
print(json.dumps([seen, first_with_widgets]))
"""


@cache
def _imported_one_by_one() -> tuple[list[str], dict[str, str]]:
    """Return what importing our modules did, and which first loaded widgets: once for all tests."""
    modules = _modules()
    assert len(modules) > 20
    groups = {
        "script": ["cosmic", "cosmic.app.rig"],
        "plain": [module for module in modules if not _has_widgets(module)],
        "rest": [module for module in modules if _has_widgets(module)],
    }
    done = subprocess.run(
        [sys.executable, "-B", "-c", WATCHED_IMPORT, str(SOURCE), json.dumps(groups)],
        capture_output=True,
        text=True,
        timeout=100,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    seen, first_with_widgets = json.loads(done.stdout.splitlines()[-1])
    return seen, first_with_widgets


def test_importing_any_module_opens_no_file_no_window_and_starts_no_thread() -> None:
    seen, first_with_widgets = _imported_one_by_one()
    assert "rest" in first_with_widgets, "widgets are seen where there are some"
    assert seen == []


def test_a_script_that_connects_loads_no_widgets() -> None:
    assert "script" not in _imported_one_by_one()[1]


def test_modules_outside_gui_and_app_load_no_widgets() -> None:
    assert "plain" not in _imported_one_by_one()[1]


def test_methods_that_qt_calls_are_marked_with_the_override_that_survives_an_exception() -> None:
    wrong = [
        str(file.relative_to(ROOT))
        for file in (SOURCE / "cosmic").rglob("*.py")
        for text in [file.read_text(encoding="utf-8")]
        if re.search(r"from typing(_extensions)? import .*\boverride\b", text)
        and re.search(r"from PySide6\.QtWidgets import|from PySide6\.QtGui import", text)
    ]
    assert wrong == [], "import override from cosmic.frame.overrides: see its docstring"


# --- Qt ---------------------------------------------------------------------------------------


class Emitter(QObject):
    changed = Signal(bool)


@pytest.mark.skipif(sys.version_info >= (3, 12), reason="True is not counted there")
def test_emitting_a_signal_drops_no_reference_to_true() -> None:
    emitter, received = Emitter(), []
    emitter.changed.connect(lambda value: received.append(value))
    emitter.changed.emit(True)
    received.clear()
    before = sys.getrefcount(True)
    for _ in range(100):
        emitter.changed.emit(False)
    assert len(received) == 100
    assert abs(sys.getrefcount(True) - before) < 20, "this PySide6 aborts after some 100 emits"


# --- the repository ---------------------------------------------------------------------------


def _repository_files() -> Iterator[Path]:
    left_out = {"__pycache__", "dist", "build"}
    for folder, folders, files in os.walk(ROOT):
        folders[:] = [
            name for name in folders if name not in left_out and (name[0] != "." or name == ".ci")
        ]
        yield from (Path(folder) / name for name in files)


def test_no_file_holds_the_address_of_a_package_registry() -> None:
    # Written in pieces, so that this file does not hold them either.
    words = ["pypi" + ".org", "python" + "hosted", "index" + "-url", "find" + "-links"]
    words += ["registry." + "npmjs", "crates" + ".io", "deb." + "debian", "archive." + "ubuntu"]
    found = []
    for file in _repository_files():
        if file.stat().st_size < 1_000_000:
            text = file.read_bytes().decode("utf-8", errors="ignore").lower()
            found += [f"{file.relative_to(ROOT)}: {word}" for word in words if word in text]
    assert found == []


def test_there_is_no_lock_file() -> None:
    names = {"uv.lock", "poetry.lock", "pdm.lock", "Pipfile.lock", "pylock.toml"}
    assert [file for file in _repository_files() if file.name in names] == []


def test_constraints_are_exact_versions_and_nothing_else() -> None:
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    pins = [line for line in lines if line and not line.startswith("#")]
    assert pins
    assert [
        pin for pin in pins if not re.fullmatch(r"[A-Za-z0-9_.-]+==[0-9][0-9A-Za-z.]*", pin)
    ] == []


def _imported(text: str) -> set[str]:
    """Return the packages that a program imports, wherever in it."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Import):
            found |= {each.name.partition(".")[0] for each in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module and not node.level:
            found.add(node.module.partition(".")[0])
    return found - sys.stdlib_module_names - {each.name for each in (ROOT / "tests").iterdir()}


def _whole(program: str) -> bool:
    with suppress(SyntaxError):
        ast.parse(program)
        return True
    return False


def _plain(requirement: str) -> str:
    found = re.match(r"[A-Za-z0-9_.-]+", requirement)
    assert found, requirement
    return re.sub(r"[-_.]+", "-", found[0]).lower()


def test_what_tests_and_tutorials_import_is_installed_with_them() -> None:
    text = (ROOT / "pyproject.toml").read_text(encoding="utf-8")
    project = tomllib.loads(text)["project"]
    groups = (project["dependencies"], *project["optional-dependencies"].values())
    declared = {_plain(each) for group in groups for each in group}
    brought = set(declared)
    for each in declared:
        with suppress(metadata.PackageNotFoundError):
            needed = [one for one in metadata.requires(each) or [] if "extra ==" not in one]
            brought |= {_plain(one) for one in needed}
    files = {each: each.read_text(encoding="utf-8") for each in (ROOT / "tests").rglob("*.py")}
    for page in DOCUMENTS:
        files[page] = "\n".join(
            each.text for each in blocks(page) if each.language == "python" and _whole(each.text)
        )
    there = metadata.packages_distributions()
    missing = {
        (str(file.relative_to(ROOT)), name)
        for file, program in files.items()
        for name in _imported(program)
        if not (ROOT / name).exists()
        and there.get(name)
        and not {_plain(each) for each in there[name]} & brought
    }
    assert missing == set(), "name it in the extra `dev` of pyproject.toml"


# --- documents --------------------------------------------------------------------------------


def _commands(document: Path) -> list[str]:
    blocks = re.findall(
        r"```(?:sh|bash|console)\n(.*?)```", document.read_text(encoding="utf-8"), flags=re.DOTALL
    )
    lines = [line.strip().removeprefix("$ ") for block in blocks for line in block.splitlines()]
    return [line for line in lines if line and not line.startswith("#")]


COMMANDS = sorted({command for document in DOCUMENTS for command in _commands(document)})
FOREIGN = {"apt-get", "cd", "git", "pip", "sudo", "python3", "source", "."}


def _accepts(arguments: list[str]) -> bool:
    """True when the command line knows the sub-command and each option named."""
    options = [word.split("=")[0] for word in arguments if word.startswith("--")]
    sub_command = [word for word in arguments[:1] if not word.startswith("-")]
    if sub_command == ["simulate"]:  # its options stand with the device that is simulated
        sub_command = arguments[:2]
    known = _help() + "".join(_help(*sub_command[: at + 1]) for at in range(len(sub_command)))
    return all(
        re.search(rf"(^|[\s,{{\[]){re.escape(each)}\b", known) for each in options + sub_command
    )


@cache
def _help(*command: str) -> str:
    return subprocess.run(
        [sys.executable, "-m", "cosmic", *command, "--help"],
        capture_output=True,
        text=True,
        check=True,
    ).stdout


@pytest.mark.parametrize("command", COMMANDS)
def test_commands_in_documents_exist(command: str) -> None:
    program, *arguments = shlex.split(command, comments=True)
    if program in {"cosmic", "./run"} or arguments[:2] == ["-m", "cosmic"]:
        rest = arguments[2:] if arguments[:2] == ["-m", "cosmic"] else arguments
        assert program != "./run" or os.access(ROOT / "run", os.X_OK)
        assert _accepts(rest)
    elif program.startswith(("./", ".ci/")):
        assert os.access(ROOT / program, os.X_OK)
    elif Path(program).name == "python":
        assert (ROOT / arguments[0]).is_file()
    else:
        assert Path(program).name in FOREIGN


# --- examples ---------------------------------------------------------------------------------


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.name)
def test_an_example_runs_to_its_end(example: Path, tmp_path: Path) -> None:
    done = subprocess.run(
        [sys.executable, str(example)],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=100,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr


# --- the tests themselves ---------------------------------------------------------------------

LITTER = """
import threading
import pytest
from PySide6.QtWidgets import QWidget
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.hooks import install_hooks
from cosmic.frame.threads import WorkerThread

kept = []

class Failing(WorkerThread):
    def run_body(self):
        raise ValueError("hm")

def test_clean(qtbot):
    widget = QWidget()
    qtbot.addWidget(widget)

def test_window(qtbot):
    kept.append(QWidget())

def test_worker(qapp):
    kept.append(WorkerThread("left", FailurePolicy()))
    kept[-1].start()

def test_thread():
    kept.append(threading.Timer(0.2, int))
    kept[-1].start()

def test_defect():
    thread = Failing("failing", FailurePolicy())
    thread.start()
    thread.join()

@pytest.mark.defects
def test_defect_provoked():
    test_defect()

def test_hooks():
    install_hooks(FailurePolicy())

@pytest.mark.hardware(moves="left.x, 10 um")
def test_rig():
    raise AssertionError
"""


def test_a_test_that_leaves_something_behind_fails(pytester: pytest.Pytester) -> None:
    pytester.makeconftest((ROOT / "tests" / "conftest.py").read_text(encoding="utf-8"))
    pytester.makepyfile(LITTER)
    pytester.makeini("[pytest]\nmarkers = hardware(moves)\nqt_api = pyside6\n")
    result = pytester.runpytest_subprocess("-p", "no:cacheprovider")
    result.assert_outcomes(passed=7, errors=5, skipped=1)
    result.stdout.fnmatch_lines_random(
        [
            "*left behind: window QWidget*",
            "*left behind: running worker thread 'left'*",
            "*left behind: thread 'Thread-*",
            "*a defect was reported*thread 'failing': ValueError: hm*",
            "*left behind: exception hooks*",
        ]
    )
