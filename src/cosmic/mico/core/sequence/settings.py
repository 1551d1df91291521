"""What platform.toml says about the initialisation sequence (thesis 7.1)."""

from enum import StrEnum
from typing import Annotated, Final, Literal, Self

from pydantic import Field, model_validator

from cosmic.frame.config import StrictModel, not_there


class StepKind(StrEnum):
    """What a step of the sequence does."""

    CALIBRATE = "calibrate"
    REFERENCE = "reference"
    END_STOP = "end_stop"
    ZERO = "zero"
    MOVE = "move"
    OPEN_GRIPPER = "open_gripper"
    CLOSE_GRIPPER = "close_gripper"
    WAIT = "wait"
    CONFIRM = "confirm"

    @property
    def moves(self) -> bool:
        """True for steps that are about axes."""
        return self not in (StepKind.WAIT, StepKind.CONFIRM)

    @property
    def needs_sensor(self) -> bool:
        """True for steps that an axis without sensor cannot make."""
        return self.moves and self not in (StepKind.OPEN_GRIPPER, StepKind.CLOSE_GRIPPER)


Kind = Literal[
    "calibrate",
    "reference",
    "end_stop",
    "zero",
    "move",
    "open_gripper",
    "close_gripper",
    "wait",
    "confirm",
]

_OWN_KEYS: Final[dict[str, tuple[StepKind, ...]]] = {
    "axes": tuple(each for each in StepKind if each.moves),
    "group": tuple(each for each in StepKind if each.moves),
    "direction": (StepKind.END_STOP,),
    "targets_um": (StepKind.MOVE,),
    "targets_deg": (StepKind.MOVE,),
    "steps": (StepKind.OPEN_GRIPPER, StepKind.CLOSE_GRIPPER),
    "amplitude_v": (StepKind.OPEN_GRIPPER, StepKind.CLOSE_GRIPPER),
    "frequency_hz": (StepKind.OPEN_GRIPPER, StepKind.CLOSE_GRIPPER),
    "wait_s": (StepKind.WAIT,),
    "text": (StepKind.CONFIRM,),
}
"""Which steps a key belongs to."""


class StepSettings(StrictModel):
    """One step of the sequence; all its axes move at once."""

    do: Kind
    axes: Annotated[tuple[str, ...], Field(strict=False)] = ()
    group: str = ""
    direction: Literal["forward", "backward"] | None = None
    targets_um: dict[str, float] = Field(default_factory=dict)
    targets_deg: dict[str, float] = Field(default_factory=dict)
    steps: Annotated[int, Field(ge=1)] | None = None
    amplitude_v: Annotated[float, Field(gt=0)] | None = None
    frequency_hz: Annotated[int, Field(ge=1)] | None = None
    wait_s: Annotated[float, Field(gt=0, le=3600)] | None = None
    text: str = ""

    @property
    def kind(self) -> StepKind:
        """What it does."""
        return StepKind(self.do)

    @property
    def targets(self) -> dict[str, float]:
        """Where the axes of a move go, in the unit of each; the start pose for those left out."""
        return {**self.targets_um, **self.targets_deg}

    @property
    def names(self) -> tuple[str, ...]:
        """The axes that it names itself; those of its group come on top."""
        return tuple(dict.fromkeys((*self.axes, *self.targets_um, *self.targets_deg)))

    @model_validator(mode="after")
    def _keys_fit(self) -> Self:
        for key, kinds in _OWN_KEYS.items():
            if getattr(self, key) and self.kind not in kinds:
                raise ValueError(f"{key} does not fit a step that does {self.do!r}")
        if self.kind.moves and not self.names and not self.group:
            raise ValueError(f"{self.do}: name its axes, or a group")
        wanted = {StepKind.END_STOP: "direction", StepKind.WAIT: "wait_s", StepKind.CONFIRM: "text"}
        key = wanted.get(self.kind, "")
        if key and not getattr(self, key):
            raise ValueError(f"{self.do}: {key} is missing")
        return self


class InitialisationSettings(StrictModel):
    """The steps that initialise the platform, in their order."""

    step: Annotated[tuple[StepSettings, ...], Field(strict=False)] = ()


def misfits(
    steps: tuple[StepSettings, ...], kinds: dict[str, str], groups: tuple[str, ...]
) -> list[str]:
    """Return what is wrong with names in `steps`, a line each.

    Parameters
    ----------
    kinds : dict of str
        "linear", "rotary" or "open-loop" of every positioner, by name.
    groups : tuple of str
        Titles of all groups.
    """
    wrong: list[str] = []
    for number, step in enumerate(steps):
        where = f"initialisation.step[{number}]"
        if step.group and step.group not in groups:
            wrong.append(f"{where}: {not_there('group', step.group, groups)}")
        wrong += [
            f"{where}: {not_there('positioner', name, kinds)}"
            for name in step.names
            if name not in kinds
        ]
        wrong += [f"{where}: {text}" for text in _wrong_kinds(step, kinds)]
    return wrong


def _wrong_kinds(step: StepSettings, kinds: dict[str, str]) -> list[str]:
    known = [name for name in step.names if name in kinds]
    if step.kind.needs_sensor:
        wrong = [name for name in known if kinds[name] == "open-loop"]
        lines = [f"{name} has no sensor: it cannot {step.do.replace('_', ' ')}" for name in wrong]
    elif step.kind.moves:
        wrong = [name for name in known if kinds[name] != "open-loop"]
        lines = [f"{name} is not a gripper: it has a sensor" for name in wrong]
    else:
        return []
    for key, kind in (("targets_um", "linear"), ("targets_deg", "rotary")):
        lines += [
            f"{key}: {name} is {kinds[name]}"
            for name in getattr(step, key)
            if name in kinds and kinds[name] != kind and name not in wrong
        ]
    return lines
