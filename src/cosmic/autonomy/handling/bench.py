"""What all hands on one plate share: what lies on it, and places for one at a time."""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Generic, Self, TypeVar, overload

from cosmic.autonomy.handling.in_hand import FibreInHand
from cosmic.autonomy.handling.live import LastSeen
from cosmic.autonomy.handling.plate import Candidate
from cosmic.autonomy.procedures.resources import Resource
from cosmic.vico.core.pixel_map import Floats

if TYPE_CHECKING:
    from cosmic.autonomy.handling.work import FibreWork

T = TypeVar("T")


def _never() -> bool:
    return False


@dataclass(slots=True, eq=False)
class Bench:
    """What all hands share; belongs to the thread of the run.

    Attributes
    ----------
    candidates : list of Candidate
        Of the last survey, less those that were taken; on the plate.
    given_up : list of Candidate
        Those on which grasping failed: they are not tried a second time.
    spilled : list of FibreInHand
        Those that were measured, and fell on the way to the bin: they lie on the plate again.
    skipped : Counter of str
        Why fibres of the last survey are not taken, and how many.
    finished : list of FibreInHand
        Those that were put away.
    distrusted : bool
        Positions are not to be believed before the platform was initialised again.
    seen : LastSeen
        By which a frozen camera is known.
    plate, probe : Resource
        The plate with table and view of it, and the place in front of the probe: where several
        hands work, each is used by one at a time.
    hands : dict of str to FibreWork
        Where several work, each by its gripper's name.
    enough : callable
        Says whether no further fibre is to be begun, for a procedure that treats many.
    """

    candidates: list[Candidate] = field(default_factory=list)
    lines_um: list[Floats] = field(default_factory=list)
    given_up: list[Candidate] = field(default_factory=list)
    spilled: list[FibreInHand] = field(default_factory=list)
    skipped: Counter[str] = field(default_factory=Counter)
    zoomed: float | None = None
    surveyed: bool = False
    since_survey: int = 0
    survey_deg: float = 0.0
    finished: list[FibreInHand] = field(default_factory=list)
    numbers: int = 0
    distrusted: bool = False
    seen: LastSeen = field(default_factory=LastSeen)
    plate: Resource = field(default_factory=lambda: Resource("the plate", 0))
    probe: Resource = field(default_factory=lambda: Resource("the probe", 1))
    hands: "dict[str, FibreWork]" = field(default_factory=dict)
    enough: Callable[[], bool] = _never


class OfBench(Generic[T]):
    """Something of the bench that each hand has as if it were its own."""

    _name = ""

    def __set_name__(self, owner: type[Any], name: str) -> None:
        self._name = name

    @overload
    def __get__(self, work: None, owner: type[Any]) -> Self: ...

    @overload
    def __get__(self, work: "FibreWork", owner: type[Any]) -> T: ...

    def __get__(self, work: "FibreWork | None", owner: type[Any]) -> Self | T:
        if work is None:
            return self
        value: T = getattr(work.bench, self._name)
        return value

    def __set__(self, work: "FibreWork", value: T) -> None:
        setattr(work.bench, self._name, value)
