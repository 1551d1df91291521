"""What a recorded procedure consists of: steps as data, as a readable file, and as Python."""

import json
from pathlib import Path
from typing import Annotated, Final, Literal, Self

import tomlkit
from pydantic import Field, ValidationError, model_validator
from typing_extensions import override

from cosmic.autonomy.shipped.single_operation import OperationRequest, SingleOperation
from cosmic.frame.config import StrictModel, read_toml
from cosmic.frame.errors import ConfigError
from cosmic.frame.kept_file import write_whole

PLATFORM: Final = "platform"
FIBRE: Final = "fibre"
PLATE: Final = "plate"
FRAMES: Final = (PLATFORM, FIBRE, PLATE)
"""What a point may be relative to, beside the tip of a tool, which is given by its name."""
NUMBERS: Final = {
    "opening_um": "opening, µm",
    "zoom": "zoom",
    "focus_counts": "focus, counts",
    "percent": "light, %",
    "force_un": "force, µN",
    "timeout_s": "longest wait, s",
    "seconds": "time, s",
}
"""Keys of steps that are single numbers, and how they are read."""


class RecordedStep(StrictModel):
    """One step.

    Attributes
    ----------
    ask : dict of str to str
        Keys of this step that are asked for at each replay, with the words that ask.
    """

    ask: dict[str, str] = Field(default_factory=dict)

    @model_validator(mode="after")
    def _asks_for_numbers(self) -> Self:
        for key in self.ask:
            if not isinstance(getattr(self, key, None), int | float):
                raise ValueError(f"ask: {key!r} is not a number of this step")
        return self

    @property
    def words(self) -> str:
        """The step in one line."""
        raise NotImplementedError

    @property
    def numbers(self) -> dict[str, float]:
        """Its single numbers, by key: they can be edited and asked for."""
        found = self.model_dump(exclude_none=True)
        return {key: float(found[key]) for key in NUMBERS if key in found}

    @property
    def table(self) -> dict[str, object]:
        """It as a person reads it in a file: without what says nothing."""
        found = self.model_dump(mode="json", exclude_none=True)
        return {key: value for key, value in found.items() if value not in ("", {})}


class MoveStep(RecordedStep):
    """A movement of a tool, or of single axes, all together.

    Attributes
    ----------
    tool : str
        Whose tip goes to `point_um`; empty where only `axes` move.
    point_um : (float, float, float)
        Of the tip, x, y and z; x and y from the middle of the fibre, from the rotation centre of
        the plate and turning with it, or from the tip of another tool.
    relative_to : str
        "platform", "fibre", "plate", or the name of a tool.
    axes : dict of str to float
        Further axes, absolute; um or degrees.
    """

    kind: Literal["move"] = "move"
    tool: str = ""
    point_um: tuple[float, float, float] = (0.0, 0.0, 0.0)
    relative_to: str = PLATFORM
    axes: dict[str, float] = Field(default_factory=dict)

    @property
    @override
    def words(self) -> str:
        """The step in one line."""
        parts = []
        if self.tool:
            x, y, z = self.point_um
            beside = "" if self.relative_to == PLATFORM else f" from the {self.relative_to}"
            parts.append(f"{self.tool} to {x:.0f}, {y:.0f}, {z:.0f} µm{beside}")
        parts += [f"{name} to {value:.1f}" for name, value in self.axes.items()]
        return f"Move {', '.join(parts)}"

    @property
    @override
    def table(self) -> dict[str, object]:
        """It as a person reads it in a file: without what says nothing."""
        pointless = () if self.tool else ("point_um", "relative_to")
        return {key: value for key, value in super().table.items() if key not in pointless}


class GripperStep(RecordedStep):
    """A gripper opens or closes to a width, as its steps are counted."""

    kind: Literal["gripper"] = "gripper"
    tool: str
    opening_um: float = Field(ge=0.0)

    @property
    @override
    def words(self) -> str:
        """The step in one line."""
        return f"Open {self.tool} to {self.opening_um:.0f} µm"


class LensStep(RecordedStep):
    """The lens zooms, focuses, or both."""

    kind: Literal["lens"] = "lens"
    zoom: float | None = Field(None, gt=0.0)
    focus_counts: int | None = Field(None, ge=0)

    @property
    @override
    def words(self) -> str:
        """The step in one line."""
        zoom = f"zoom {self.zoom:.3g}x" if self.zoom is not None else ""
        focus = f"focus {self.focus_counts} counts" if self.focus_counts is not None else ""
        return f"Lens: {', '.join(filter(None, [zoom, focus]))}"


class LightStep(RecordedStep):
    """The light is set."""

    kind: Literal["light"] = "light"
    percent: float = Field(ge=0.0, le=100.0)

    @property
    @override
    def words(self) -> str:
        """The step in one line."""
        return f"Light {self.percent:.0f} %"


class RecordStep(RecordedStep):
    """A recording begins, or ends where `name` is empty."""

    kind: Literal["record"] = "record"
    name: str = ""

    @property
    @override
    def words(self) -> str:
        """The step in one line."""
        return f"Record {self.name}" if self.name else "End the recording"


class WaitForForceStep(RecordedStep):
    """It goes on once a force is reached, either sign."""

    kind: Literal["wait for force"] = "wait for force"
    channel: str = "force"
    force_un: float = Field(gt=0.0)
    timeout_s: float = Field(60.0, gt=0.0)

    @property
    @override
    def words(self) -> str:
        """The step in one line."""
        return f"Wait until {self.channel} reaches {self.force_un:g} µN"


class WaitForOperatorStep(RecordedStep):
    """It goes on once the operator says so: by a key, or by a mark in the recording."""

    kind: Literal["wait for key", "wait for mark"] = "wait for key"
    text: str = ""

    @property
    @override
    def words(self) -> str:
        """The step in one line."""
        return f"{self.kind.capitalize()}{f': {self.text}' if self.text else ''}"


class PauseStep(RecordedStep):
    """Nothing happens for a while."""

    kind: Literal["pause"] = "pause"
    seconds: float = Field(gt=0.0)

    @property
    @override
    def words(self) -> str:
        """The step in one line."""
        return f"Pause {self.seconds:g} s"


class OperationStep(RecordedStep):
    """An operation on the fibre, such as a campaign makes."""

    kind: Literal["operation"] = "operation"
    operation: SingleOperation
    gripper: str = ""
    force_un: float = Field(50.0, gt=0.0)

    @property
    @override
    def words(self) -> str:
        """The step in one line."""
        return OperationRequest(self.operation, self.gripper, self.force_un).title

    @property
    @override
    def numbers(self) -> dict[str, float]:
        """Its single numbers, by key: they can be edited and asked for."""
        return super().numbers if self.operation is SingleOperation.PUSH else {}

    @property
    @override
    def table(self) -> dict[str, object]:
        """It as a person reads it in a file: without what says nothing."""
        kept = {**self.numbers, **self.ask}
        found = super().table
        return {key: value for key, value in found.items() if key != "force_un" or key in kept}


Step = Annotated[
    MoveStep
    | GripperStep
    | LensStep
    | LightStep
    | RecordStep
    | WaitForForceStep
    | WaitForOperatorStep
    | PauseStep
    | OperationStep,
    Field(discriminator="kind"),
]


class RecordedProcedure(StrictModel):
    """A name, and steps in order."""

    name: str
    step: list[Step] = Field(default_factory=list)

    @property
    def asked(self) -> dict[tuple[int, str], tuple[str, float]]:
        """What a replay asks for: by step and key, the words, and the value recorded."""
        return {
            (number, key): (words, float(getattr(step, key)))
            for number, step in enumerate(self.step)
            for key, words in step.ask.items()
        }

    @property
    def given(self) -> tuple[tuple[str, str], ...]:
        """What a replay asks for, as it is read: step and quantity, the value with its unit."""
        found = []
        for (number, key), (_, value) in self.asked.items():
            quantity, _, unit = NUMBERS.get(key, key).partition(", ")
            found.append((f"step {number + 1}, {quantity}", f"{value:g} {unit}".strip()))
        return tuple(found)

    def with_values(self, values: dict[tuple[int, str], float]) -> "RecordedProcedure":
        """Return it with other values for what is asked; raises `ConfigError`."""
        steps = [each.model_dump(mode="json") for each in self.step]
        for (number, key), value in values.items():
            steps[number][key] = int(value) if value.is_integer() else value  # counts are whole
        return _checked({"name": self.name, "step": steps}, self.name)

    @property
    def needs_fibre(self) -> bool:
        """True where a fibre must be marked before it is replayed."""
        return any(
            (isinstance(each, MoveStep) and each.relative_to == FIBRE)
            or (isinstance(each, OperationStep) and each.operation is SingleOperation.TAKE)
            for each in self.step
        )

    @property
    def waits(self) -> str:
        """The first step that waits for the operator, in words; empty where none does."""
        waiting = (each.words for each in self.step if isinstance(each, WaitForOperatorStep))
        return next(waiting, "")

    def save(self, path: Path) -> None:
        """Write it as a readable file; raises `OSError`."""
        steps = [each.table for each in self.step]
        write_whole(path, tomlkit.dumps({"name": self.name, "step": steps}))

    def save_python(self, path: Path, config: Path | None = None) -> None:
        """Write it as a script that replays it; raises `OSError`.

        Parameters
        ----------
        config : Path or None
            The platform file that it is replayed on; None: the simulated platform.
        """
        write_whole(path, python_of(self, config))


def load_recorded(path: Path) -> RecordedProcedure:
    """Read a file written by `RecordedProcedure.save`.

    Raises
    ------
    ConfigError
        It cannot be read, or is no recorded procedure; the text names the key.
    """
    return _checked(read_toml(path), str(path))


def _checked(data: dict[str, object], where: str) -> RecordedProcedure:
    try:
        return RecordedProcedure.model_validate_json(json.dumps(data))  # tables know no tuples
    except TypeError as exc:  # a date
        raise ConfigError(f"{where}: {exc}") from exc
    except RecursionError:
        raise ConfigError(f"{where}: its tables lie too deep") from None
    except ValidationError as exc:
        lines = [
            f"{where}: {'.'.join(str(part) for part in each['loc'])}: {each['msg']}"
            for each in exc.errors()
        ]
        raise ConfigError("\n".join(lines)) from exc


_SCRIPT: Final = '''"""{title}: recorded with CoSMic.

python THIS_FILE replays it on the platform that is named below. A procedure that begins with a
fibre takes the first that is certain.
"""

import cosmic
from cosmic.autonomy.recorded.steps import (
    RecordedProcedure,
{imports}
)
{further}
PROCEDURE = RecordedProcedure(
    name={name!r},
    step=[
{steps}
    ],
)


{asking}def main() -> None:
    """Replay it."""
    with cosmic.connect({config}) as rig:
        rig.replay(PROCEDURE{confirm}).run_here()


if __name__ == "__main__":
    main()
'''


_ASKING: Final = '''def ask(words: str) -> bool:
    """Wait for the operator."""
    return not input(f"{words}. Enter goes on, any other answer ends it: ")


'''


def python_of(procedure: RecordedProcedure, config: Path | None = None) -> str:
    """Return a script that replays a procedure on the platform of a file."""
    kinds = sorted({type(each).__name__ for each in procedure.step})
    lines = []
    for each in procedure.step:
        given = {
            key: value
            for key, value in each.model_dump(mode="python", exclude_defaults=True).items()
            if key != "kind" or isinstance(each, WaitForOperatorStep)
        }
        fields = ", ".join(f"{key}={_source(value)}" for key, value in given.items())
        lines.append(f"        {type(each).__name__}({fields}),  # {_in_one_line(each.words)}")
    uses = any(isinstance(each, OperationStep) for each in procedure.step)
    more = "from cosmic.autonomy.shipped.fibre_handling import SingleOperation\n" if uses else ""
    return _SCRIPT.format(
        title=_in_one_line(procedure.name).replace("\\", r"\\").replace('"', r"\""),
        name=procedure.name,
        imports="\n".join(f"    {kind}," for kind in kinds),
        further=more,
        steps="\n".join(lines),
        asking=_ASKING if procedure.waits else "",
        confirm=", confirm=ask" if procedure.waits else "",
        config="" if config is None else repr(str(config)),
    )


def _in_one_line(text: str) -> str:
    return " ".join(text.split())


def _source(value: object) -> str:
    if isinstance(value, SingleOperation):
        return f"SingleOperation.{value.name}"
    return repr(value)
