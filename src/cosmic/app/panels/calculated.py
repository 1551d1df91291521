"""A channel that is calculated from the others while they come, such as ``force - 2 * spare``."""

import ast
import operator
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Final

import numpy as np

from cosmic.daqco.core.chunk import DataChunk, Values
from cosmic.daqco.core.scale import Scale
from cosmic.daqco.gui.plot.chart import Chart, Trace
from cosmic.daqco.gui.plot.unit_ranges import UnitRanges
from cosmic.daqco.gui.plot.units import AxisRange
from cosmic.frame.errors import ConfigError
from cosmic.frame.gui.palette import OKABE_ITO

LONGEST: Final = 200
NAME: Final = "calculated"
UNIT: Final = ""
_OPERATORS: Final[Mapping[type, Callable[[Values, Values], Values]]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
}
_FUNCTIONS: Final[Mapping[str, Callable[[Values], Values]]] = {"abs": np.abs, "sqrt": np.sqrt}


class Calculation:
    """A formula of channels, numbers, ``+ - * /``, brackets, ``abs()`` and ``sqrt()``; any thread.

    Parameters
    ----------
    formula : str
        As a person writes it.

    Raises
    ------
    ConfigError
        It is none, or holds anything else: a formula never runs code.
    """

    def __init__(self, formula: str) -> None:
        self.formula = formula.strip()
        if len(self.formula) > LONGEST:
            raise ConfigError(f"a formula has up to {LONGEST} signs")
        try:
            self._tree = ast.parse(self.formula, mode="eval").body
        except (SyntaxError, ValueError, RecursionError, MemoryError):
            raise ConfigError(
                f"{self.formula!r} is not a formula, such as force - 2 * spare"
            ) from None
        names: set[str] = set()
        self._check(self._tree, names)
        if not names:
            raise ConfigError("a formula needs a channel, such as force - 2 * spare")
        self.channels: Final = frozenset(names)

    def _check(self, node: ast.expr, names: set[str]) -> None:
        name = _channel(node)
        if name:
            names.add(name)
        elif isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
            self._check(node.left, names)
            self._check(node.right, names)
        elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.UAdd):
            self._check(node.operand, names)
        elif isinstance(node, ast.Call) and _function(node):
            self._check(node.args[0], names)
        elif not (isinstance(node, ast.Constant) and type(node.value) in (int, float)):
            part = ast.get_source_segment(self.formula, node) or self.formula
            raise ConfigError(f"{part!r}: only channels, numbers, + - * /, abs() and sqrt()")

    def missing(self, channels: tuple[str, ...]) -> str:
        """Return why it cannot be calculated from these channels; empty when it can."""
        lacks = sorted(self.channels - set(channels))
        known = ", ".join(channels) or "none"
        return f"no channel {lacks[0]}; there are {known}" if lacks else ""

    def of(self, values: Mapping[str, Values]) -> Values:
        """Return the result for values of the channels; what has none, such as 1 / 0, is NaN."""
        with np.errstate(all="ignore"):
            found = np.asarray(self._of(self._tree, values), float)
        return np.where(np.isfinite(found), found, np.nan)

    def _of(self, node: ast.expr, values: Mapping[str, Values]) -> Values:
        name = _channel(node)
        if name:
            return values[name]
        if isinstance(node, ast.BinOp):
            left, right = self._of(node.left, values), self._of(node.right, values)
            return _OPERATORS[type(node.op)](left, right)
        if isinstance(node, ast.UnaryOp):
            inner = self._of(node.operand, values)
            return -inner if isinstance(node.op, ast.USub) else inner
        if isinstance(node, ast.Call):
            return _FUNCTIONS[_function(node)](self._of(node.args[0], values))
        assert isinstance(node, ast.Constant)
        return np.asarray(node.value, float)

    def chunk(self, chunk: DataChunk) -> DataChunk:
        """Return a chunk whose one channel is the result."""
        values = dict(zip(chunk.channels, chunk.values, strict=True))
        result = np.broadcast_to(self.of(values), (chunk.samples,)).copy()[None, :]
        scale = Scale(NAME, "V")
        return replace(chunk, channels=(NAME,), volts=result, scales=(scale,))


def _channel(node: ast.expr) -> str:
    """Return the name of a channel, which may have one point in it; empty for anything else."""
    if isinstance(node, ast.Name):
        return node.id
    if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
        return f"{node.value.id}.{node.attr}"
    return ""


def _function(node: ast.Call) -> str:
    known = isinstance(node.func, ast.Name) and node.func.id in _FUNCTIONS
    if not known or len(node.args) != 1 or node.keywords:
        return ""
    return _channel(node.func)


class CalculatedCurve(Chart):
    """Draws a calculation over time, with an axis that follows it; GUI thread."""

    def __init__(self) -> None:
        super().__init__()
        self.calculation: Calculation | None = None
        self._ranges_known = UnitRanges()

    @property
    def newest(self) -> float | None:
        """The newest value; None where there is none."""
        view = self.now_view()
        if not self.calculation or not view.end:
            return None
        value = float(view.samples(view.end - 1, view.end)[1][0, 0])
        return value if np.isfinite(value) else None

    def calculate(self, calculation: Calculation, rate_hz: float, span_s: float) -> None:
        """Draw this from now on."""
        self.calculation = calculation
        self._ranges_known.put(UNIT, AxisRange(-1.0, 1.0, 0.5))
        self.begin([Trace(NAME, UNIT, OKABE_ITO["sky blue"])], rate_hz)
        self.set_span(span_s)
        self.set_ranges(self._ranges_known.shown(self.traces))

    def feed_from(self, chunks: list[DataChunk]) -> None:
        """Calculate and draw what chunks of all channels give."""
        calculation = self.calculation
        if calculation is None:
            return
        usable = [each for each in chunks if not calculation.missing(each.channels)]
        self.feed([calculation.chunk(each) for each in usable])
        if usable and self._ranges_known.fit(self.traces, self.visible_columns()):
            self.set_ranges(self._ranges_known.shown(self.traces))
