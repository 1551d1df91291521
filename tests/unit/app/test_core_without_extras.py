"""What is installed without an extra is enough for every command and window."""

import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[3]

# Imports every module, as if nothing were installed but what the core asks for and what that asks
# for in turn; prints what could not be imported.
CODE = """
import importlib, pkgutil, re, sys
from importlib import metadata
from importlib.machinery import PathFinder

def bare(line):
    return re.split(r"[^\\w.-]", line)[0].lower().replace("_", "-")

wanted, there = set(map(bare, sys.argv[1:])), set()
while wanted - there:
    name = (wanted - there).pop()
    there.add(name)
    try:
        lines = metadata.requires(name) or ()
    except metadata.PackageNotFoundError:
        continue  # for another system
    wanted |= {bare(line) for line in lines if "extra ==" not in line}
brought = metadata.packages_distributions()

class Installed(PathFinder):
    @classmethod
    def find_spec(cls, name, path=None, target=None):
        owners = {bare(each) for each in brought.get(name.partition(".")[0], ())}
        absent = owners and not owners & (there | {"cosmic"})
        return None if absent else PathFinder.find_spec(name, path, target)

sys.meta_path[sys.meta_path.index(PathFinder)] = Installed
import cosmic
for module in pkgutil.walk_packages(cosmic.__path__, "cosmic."):
    if not module.name.endswith("__main__"):
        try:
            importlib.import_module(module.name)
        except ModuleNotFoundError as exc:
            print(module.name, exc.name)
"""
NEEDS_NET = ("cosmic.frame.network.",)
GATEWAYS = {
    "cosmic.app.gateways.http": {"starlette", "uvicorn"},
    "cosmic.app.gateways.http_answers": {"starlette"},
    "cosmic.app.gateways.http_server": {"uvicorn"},
    "cosmic.app.gateways.mcp": {"starlette"},
    "cosmic.app.gateways.websocket_line": {"starlette"},
    "cosmic.app.gateways.epics": {"caproto"},
    "cosmic.app.gateways.epics_channels": {"caproto"},
    "cosmic.app.gateways.epics_image": {"caproto"},
    "cosmic.app.gateways.epics_motor": {"caproto"},
}
NEEDS_PYTEST = ("cosmic.testing.",)


def test_only_the_network_needs_an_extra() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    ended = subprocess.run(
        [sys.executable, "-c", CODE, *project["dependencies"]],
        capture_output=True,
        text=True,
        check=True,
        timeout=115,
    )
    missed = dict(line.split() for line in ended.stdout.splitlines())
    suites = {name for name in missed if name.startswith(NEEDS_PYTEST)}
    assert {missed.pop(name) for name in suites} == {"pytest"}, "suites need pytest, nothing else"
    for name, extras in GATEWAYS.items():
        assert missed.pop(name, "") in {*extras, ""}
    assert not {name: lacking for name, lacking in missed.items() if not name.startswith(NEEDS_NET)}
    lacking = set(missed.values())
    assert lacking <= {"msgpack", "zenoh", "cryptography"}
    for name in ("application", "link", "remote_task"):
        assert f"cosmic.frame.network.{name}" not in missed, "what has no station loads it too"
