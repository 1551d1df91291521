"""Measure how the sources are cut: files, classes, forwarding, crumbs, cycles, floors, one click.

    python -m benchmarks.house                 # of this checkout, as a Markdown table
    python -m benchmarks.house --root PATH     # of another one
    python -m benchmarks.house --name          # the methods, modules and files that are counted
    python -m benchmarks.house --no-click      # without opening a window

These are figures, not limits: a joined file that does two things is worse than two files.
"""

import argparse
import ast
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from statistics import median
from typing import Final

ROOT: Final = Path(__file__).resolve().parents[1]
PACKAGE: Final = "cosmic"
CRUMB_LINES: Final = 100
LARGEST_LINES: Final = 600
MIRRORS: Final = ("remote_*.py", "station_*.py", "ports.py", "*_port.py")
NO_MIRRORS: Final = ("serial_port.py",)
"""A port of the computer, not of a subsystem."""
STOREYS: Final = f"{PACKAGE}.mico.core"
CLICK_S: Final = 600.0


@dataclass(frozen=True, slots=True)
class Found:
    """One figure and what was counted."""

    name: str
    value: int
    names: tuple[str, ...] = ()


@dataclass(slots=True)
class Module:
    """One file of the sources."""

    name: str
    file: Path
    tree: ast.Module
    lines: int
    imports: set[str] = field(default_factory=set)


def read(root: Path) -> dict[str, Module]:
    """Return all modules of a checkout with what they import of each other, for types as well."""
    source = root / "src"
    modules: dict[str, Module] = {}
    for file in sorted((source / PACKAGE).rglob("*.py")):
        parts = file.relative_to(source).with_suffix("").parts
        name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
        text = file.read_text(encoding="utf-8")
        modules[name] = Module(name, file, ast.parse(text), len(text.splitlines()))
    for module in modules.values():
        module.imports = {each for each in _imported(module, modules) if each != module.name}
    return modules


def _imported(module: Module, modules: Mapping[str, Module]) -> Iterator[str]:
    for node in ast.walk(module.tree):
        if isinstance(node, ast.Import):
            yield from (each.name for each in node.names if each.name in modules)
        elif isinstance(node, ast.ImportFrom) and node.module in modules:
            inside = [f"{node.module}.{each.name}" for each in node.names]
            yield from (each for each in inside if each in modules)
            if any(each not in modules for each in inside):
                yield node.module


def forwarding(modules: Mapping[str, Module], *, same: bool) -> list[str]:
    """Return the methods that do nothing but ask a part of their object.

    Parameters
    ----------
    same : bool
        Only those that ask for the same: by the same name, or with the same arguments.
    """
    return [
        f"{module.name}.{owner.name}.{method.name}"
        for module in modules.values()
        for owner in ast.walk(module.tree)
        if isinstance(owner, ast.ClassDef)
        for method in owner.body
        if isinstance(method, (ast.FunctionDef, ast.AsyncFunctionDef))
        and _forwards(method, same=same)
    ]


def _forwards(method: ast.FunctionDef | ast.AsyncFunctionDef, *, same: bool) -> bool:
    """Return True where the body is one call of, or one look at, an attribute of an attribute."""
    body = method.body[1:] if ast.get_docstring(method) is not None else method.body
    if len(body) != 1 or not isinstance(body[0], (ast.Return, ast.Expr)):
        return False
    asked = body[0].value
    if isinstance(asked, ast.Await):
        asked = asked.value
    if isinstance(asked, ast.Attribute):
        return _of_part(asked) and (asked.attr == method.name or not same)
    if not (isinstance(asked, ast.Call) and isinstance(asked.func, ast.Attribute)):
        return False
    alike = asked.func.attr == method.name or _given(asked) == _taken(method)
    return _of_part(asked.func) and (alike or not same)


def _of_part(node: ast.Attribute) -> bool:
    """Return True for `self.part.name`, however deep the part is."""
    inner = node.value
    if not isinstance(inner, ast.Attribute):
        return False
    while isinstance(inner, ast.Attribute):
        inner = inner.value
    return isinstance(inner, ast.Name) and inner.id == "self"


def _given(call: ast.Call) -> list[str]:
    given = [*call.args, *(each.value for each in call.keywords)]
    return [ast.unparse(each).lstrip("*") for each in given]


def _taken(method: ast.FunctionDef | ast.AsyncFunctionDef) -> list[str]:
    taken = method.args
    more = [each for each in (taken.vararg, taken.kwarg) if each is not None]
    every = [*taken.posonlyargs, *taken.args, *taken.kwonlyargs, *more]
    return [each.arg for each in every if each.arg != "self"]


def crumbs(modules: Mapping[str, Module]) -> list[str]:
    """Return the short modules that exactly one other module imports, which stands beside them."""
    importers: dict[str, set[str]] = {}
    for module in modules.values():
        for each in module.imports:
            importers.setdefault(each, set()).add(module.name)
    return [
        module.name
        for module in modules.values()
        if module.lines < CRUMB_LINES
        and module.file.name != "__init__.py"
        and len(users := importers.get(module.name, set())) == 1
        and _folder(next(iter(users)), modules) == module.file.parent
    ]


def _folder(name: str, modules: Mapping[str, Module]) -> Path:
    return modules[name].file.parent


def rings(graph: Mapping[str, Iterable[str]]) -> list[list[str]]:
    """Return the groups of modules that import each other in a ring (Tarjan's algorithm)."""
    order: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    found: list[list[str]] = []

    def visit(name: str) -> None:
        order[name] = low[name] = len(order)
        stack.append(name)
        for each in graph[name]:
            if each not in order:
                visit(each)
                low[name] = min(low[name], low[each])
            elif each in stack:
                low[name] = min(low[name], order[each])
        if low[name] == order[name]:
            ring = [stack.pop()]
            while ring[-1] != name:
                ring.append(stack.pop())
            found.append(ring)

    for name in graph:
        if name not in order:
            visit(name)
    return found


def chain(modules: Mapping[str, Module], package: str) -> list[str]:
    """Return the longest chain of imports within a package; a ring counts as one module."""
    inside = {name for name in modules if name.startswith(f"{package}.")}
    graph = {name: sorted(modules[name].imports & inside) for name in sorted(inside)}
    ring_of = {name: ring[0] for ring in rings(graph) for name in ring}

    @cache
    def below(ring: str) -> tuple[str, ...]:
        members = [name for name, own in ring_of.items() if own == ring]
        under = {ring_of[each] for name in members for each in graph[name]} - {ring}
        return (ring, *max((below(each) for each in sorted(under)), key=len, default=()))

    return list(max((below(ring) for ring in sorted(set(ring_of.values()))), key=len, default=()))


def mirrors(modules: Mapping[str, Module]) -> list[Module]:
    """Return the files that repeat an application for a station or for a window."""
    return [
        module
        for module in modules.values()
        if any(module.file.match(pattern) for pattern in MIRRORS)
        and module.file.name not in NO_MIRRORS
    ]


def cut(root: Path) -> list[Found]:
    """Return all figures that need no running program."""
    sys.setrecursionlimit(10_000)
    modules = read(root)
    every = modules.values()
    small, alike = crumbs(modules), forwarding(modules, same=True)
    methods = forwarding(modules, same=False)
    classes = sum(isinstance(node, ast.ClassDef) for m in every for node in ast.walk(m.tree))
    ringed = [r for r in rings({m.name: sorted(m.imports) for m in every}) if len(r) > 1]
    large = [f"{m.name}: {m.lines}" for m in every if m.lines > LARGEST_LINES]
    copied, longest = mirrors(modules), chain(modules, STOREYS)
    inside = f"modules imported by one neighbour only, below {CRUMB_LINES} lines"
    return [
        Found("files in src", len(modules)),
        Found("lines in src", sum(module.lines for module in every)),
        Found("median lines of a file", int(median(module.lines for module in every))),
        Found(f"files above {LARGEST_LINES} lines", len(large), tuple(large)),
        Found("classes", classes),
        Found("methods that only ask a part", len(methods), tuple(methods)),
        Found("of these, by the same name or with the same arguments", len(alike), tuple(alike)),
        Found(inside, len(small), tuple(small)),
        Found(
            "modules in an import cycle, type-checking imports counted",
            sum(len(ring) for ring in ringed),
            tuple(" - ".join(ring) for ring in ringed),
        ),
        Found(
            f"lines in {', '.join(f'`{each}`' for each in MIRRORS)}",
            sum(module.lines for module in copied),
            tuple(f"{module.name}: {module.lines}" for module in copied),
        ),
        Found("floors of `mico/core`", len(longest), tuple(longest)),
    ]


def click(root: Path) -> list[Found]:
    """Return the files that "Go to" runs through, in a window of a checkout, offscreen."""
    with tempfile.TemporaryDirectory() as folder:
        kept = Path(folder) / "click.json"
        environment = {
            **os.environ,
            "PYTHONPATH": str(root / "src"),
            "QT_QPA_PLATFORM": "offscreen",
        }
        command = [sys.executable, "-m", "benchmarks.house_child", str(root / "src"), str(kept)]
        subprocess.run(command, cwd=ROOT, env=environment, check=True, timeout=CLICK_S)
        read_back = json.loads(kept.read_text(encoding="utf-8"))
    return [Found(each["name"], len(each["names"]), tuple(each["names"])) for each in read_back]


def main() -> None:
    """Read the command line, measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--root", type=Path, default=ROOT, help="the checkout to measure")
    parser.add_argument("--name", action="store_true", help="name what is counted")
    parser.add_argument("--no-click", action="store_true", help="open no window")
    asked = parser.parse_args()
    root = asked.root.resolve()
    figures = cut(root) + ([] if asked.no_click else click(root))
    print("| | |\n|---|---:|")
    for each in figures:
        print(f"| {each.name} | {each.value:,} |")
    if asked.name:
        for each in figures:
            print(f"\n{each.name}:")
            print("\n".join(f"    {name}" for name in each.names))


if __name__ == "__main__":
    main()
