"""`Procedure`: the parts put together, with a name and a way to leave things safe."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

from cosmic.autonomy.procedures.operation import Steps, UnitOperation
from cosmic.autonomy.procedures.sharing import Role
from cosmic.autonomy.procedures.tree import OPERATION, Outline
from cosmic.autonomy.procedures.walk import Part

W = TypeVar("W")


@dataclass(frozen=True)
class Procedure(Generic[W]):
    """What to do, as a description that can be run many times.

    Attributes
    ----------
    name : str
        As shown above the tree and in records.
    root : Part
        All of it.
    make_safe : callable or None
        Its steps are carried out last when the procedure was aborted or failed, but not after a
        stop or a defect, when nothing may move.
    make_safe_s : float
        How long that may take, in the platform's time.
    """

    name: str
    root: Part[W]
    make_safe: Callable[[W], Steps] | None = None
    make_safe_s: float = 20.0


def outline_of(part: Part[W], role: str = "") -> Outline:
    """Return the shape of the tree under `part`, which is done for `role`."""
    if isinstance(part, UnitOperation):
        return Outline(part.name or type(part).__name__, OPERATION, role=role)
    role = part.name if isinstance(part, Role) else role
    below = tuple(outline_of(each, role) for each in part.parts)
    return Outline(part.name, part.kind, below, role)
