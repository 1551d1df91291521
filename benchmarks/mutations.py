"""Random edits of Python sources, by operator: for `benchmarks.mutants`."""

import ast
import copy
import random
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Final

_FLIPPED: Final[dict[type[ast.cmpop], tuple[type[ast.cmpop], ...]]] = {
    ast.Lt: (ast.LtE, ast.GtE),
    ast.LtE: (ast.Lt, ast.Gt),
    ast.Gt: (ast.GtE, ast.LtE),
    ast.GtE: (ast.Gt, ast.Lt),
    ast.Eq: (ast.NotEq,),
    ast.NotEq: (ast.Eq,),
    ast.Is: (ast.IsNot,),
    ast.IsNot: (ast.Is,),
    ast.In: (ast.NotIn,),
    ast.NotIn: (ast.In,),
}
_ARITHMETIC: Final[dict[type[ast.operator], type[ast.operator]]] = {
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
}
_QUIET: Final = ("logger", "warnings")
_WORDS: Final = ("__repr__", "__str__")
"""What is only told is not broken: its tests would be tests of words."""


@dataclass(frozen=True, slots=True)
class Edit:
    """One change of one file, in bytes of its UTF-8 text."""

    file: str
    operator: str
    line: int
    begin: int
    end: int
    before: str
    after: str


def random_edits(texts: Mapping[str, str], count: int, seed: str) -> list[Edit]:
    """Return `count` different edits of `texts`, the operator drawn first and then its place."""
    by_operator: dict[str, list[Edit]] = {}
    for file in sorted(texts):
        for edit in edits_of(file, texts[file]):
            by_operator.setdefault(edit.operator, []).append(edit)
    draw = random.Random(seed)
    chosen: list[Edit] = []
    while len(chosen) < count and by_operator:
        operator = draw.choice(sorted(by_operator))
        places = by_operator[operator]
        chosen.append(places.pop(draw.randrange(len(places))))
        if not places:
            del by_operator[operator]
    return chosen


def edits_of(file: str, text: str) -> Iterator[Edit]:
    """Yield every edit that can be made in a module."""
    lines = text.encode().splitlines(keepends=True)
    starts = [0]
    for line in lines:
        starts.append(starts[-1] + len(line))
    data = text.encode()
    for node, operator, after in _mutations(ast.parse(text)):
        begin = starts[node.lineno - 1] + node.col_offset
        end = starts[(node.end_lineno or 0) - 1] + (node.end_col_offset or 0)
        before = data[begin:end].decode()
        yield Edit(file, operator, node.lineno, begin, end, before, after)


def _mutations(tree: ast.AST) -> Iterator[tuple[ast.expr | ast.stmt, str, str]]:
    for node in _running(tree):
        if isinstance(node, ast.Compare):
            yield from _compared(node)
        elif isinstance(node, ast.BoolOp):
            other = copy.deepcopy(node)
            other.op = ast.And() if isinstance(node.op, ast.Or) else ast.Or()
            yield node, "and/or", f"({ast.unparse(other)})"
        elif isinstance(node, ast.BinOp):
            yield from _calculated(node)
        elif isinstance(node, ast.Constant):
            yield from _constant(node)
        elif isinstance(node, (ast.If, ast.While, ast.IfExp)):
            yield node.test, "condition negated", f"(not ({ast.unparse(node.test)}))"
        elif isinstance(node, ast.FunctionDef):
            yield from _returned(node)
        elif _can_go(node):
            yield node, "statement removed", "pass"


def _running(node: ast.AST) -> Iterator[ast.AST]:
    """Yield the parts of a module that run and do more than tell something."""
    for name, value in ast.iter_fields(node):
        if name in ("annotation", "returns", "decorator_list", "type_params"):
            continue
        for child in value if isinstance(value, list) else [value]:
            if isinstance(child, ast.AST) and not _only_describes(child):
                yield child
                yield from _running(child)


def _only_describes(node: ast.AST) -> bool:
    if isinstance(node, (ast.JoinedStr, ast.Import, ast.ImportFrom, ast.Assert)):
        return True
    if isinstance(node, ast.FunctionDef):
        return node.name in _WORDS
    if isinstance(node, ast.Expr):
        return isinstance(node.value, ast.Constant) or _is_quiet(node.value)
    return False


def _is_quiet(node: ast.expr) -> bool:
    while isinstance(node, (ast.Call, ast.Attribute)):
        node = node.func if isinstance(node, ast.Call) else node.value
    return isinstance(node, ast.Name) and node.id in _QUIET


def _compared(node: ast.Compare) -> Iterator[tuple[ast.expr, str, str]]:
    for place, operator in enumerate(node.ops):
        for kind in _FLIPPED[type(operator)]:
            other = copy.deepcopy(node)
            other.ops[place] = kind()
            yield node, "comparison", f"({ast.unparse(other)})"


def _calculated(node: ast.BinOp) -> Iterator[tuple[ast.expr, str, str]]:
    kind = _ARITHMETIC.get(type(node.op))
    sides = (node.left, node.right)
    if kind is None or any(isinstance(each, (ast.JoinedStr, ast.List)) for each in sides):
        return
    other = copy.deepcopy(node)
    other.op = kind()
    yield node, "arithmetic", f"({ast.unparse(other)})"


def _constant(node: ast.Constant) -> Iterator[tuple[ast.expr, str, str]]:
    match node.value:
        case bool():
            yield node, "constant", repr(not node.value)
        case int():
            yield node, "constant", repr(node.value + 1)
        case float():
            yield node, "constant", repr(2.0 * node.value + 1.0)


def _returned(node: ast.FunctionDef) -> Iterator[tuple[ast.expr, str, str]]:
    if not (isinstance(node.returns, ast.Name) and node.returns.id == "bool"):
        return
    for part in ast.walk(node):
        if isinstance(part, ast.Return) and part.value is not None:
            yield part.value, "return negated", f"(not ({ast.unparse(part.value)}))"


def _can_go(node: ast.AST) -> bool:
    """Return True for a statement whose effect is beyond its own line."""
    if isinstance(node, ast.Expr):
        return isinstance(node.value, ast.Call)
    if isinstance(node, ast.Assign):
        return any(isinstance(each, (ast.Attribute, ast.Subscript)) for each in node.targets)
    return isinstance(node, (ast.AugAssign, ast.Raise, ast.Delete, ast.Continue, ast.Break))
