"""The simulated part of a platform: its scene, the file of its truth, and all faults by name."""

import os
from pathlib import Path
from typing import Any, Final, Protocol

from cosmic.app.configuration.platform_file import PlatformFile, load_twin
from cosmic.daqco.hw.sim_faults import NAMES as BOARD_NAMES
from cosmic.frame.clock import Clock
from cosmic.frame.errors import ArgumentError
from cosmic.mico.hw.sim_faults import NAMES as CONTROLLER_NAMES
from cosmic.twin.plates import Plates
from cosmic.twin.scene import Scene
from cosmic.twin.truth import NO_TRUTH, TruthFile
from cosmic.twin.twin_faults import NAMES as SCENE_NAMES
from cosmic.twin.world import load_world
from cosmic.vico.hw.sim_camera_faults import NAMES as CAMERA_NAMES

WORLD_VARIABLE: Final = "COSMIC_WORLD"

FAULT_NAMES: Final = {
    "controller": CONTROLLER_NAMES,
    "scene": SCENE_NAMES,
    "board": BOARD_NAMES,
    "camera": CAMERA_NAMES,
}
"""Names by part; where two parts have the same, the first is meant unless the part is named."""


class _Part(Protocol):
    """What a part of the simulation offers; `where` differs from part to part."""

    @property
    def active(self) -> tuple[Any, ...]: ...

    def inject(self, name: str, **where: Any) -> None: ...

    def clear(self, name: str | None = None, **where: Any) -> None: ...


class _Waiting:
    """Keeps what is injected into a part that is not there yet."""

    def __init__(self) -> None:
        self.active: tuple[tuple[str, dict[str, Any]], ...] = ()

    def inject(self, name: str, **where: Any) -> None:
        self.active = (*self.active, (name, where))

    def clear(self, name: str | None = None, **where: Any) -> None:
        self.active = tuple(
            each
            for each in self.active
            if not (name in (None, each[0]) and where.items() <= each[1].items())
        )


class SimulationFaults:
    """Faults of the controllers, the boards, the cameras, and the scene that they all look at.

    ``inject("missed_grasp", times=2)``, ``inject("unplugged", device=1)``,
    ``inject("camera frozen")``: a name alone where only one part has it, after the part's name
    otherwise. docs/explanation/twin.md lists all of them.
    """

    def __init__(self) -> None:
        self._parts: dict[str, Any] = {}

    def join(self, part: str, faults: object) -> None:
        """Reach a part's own faults from here; done by whoever makes the part."""
        before = self._parts.get(part)
        self._parts[part] = faults
        if isinstance(before, _Waiting):
            for name, where in before.active:
                self._parts[part].inject(name, **where)

    def expect(self, part: str) -> None:
        """Keep what is injected into a part that is made later."""
        self._parts[part] = _Waiting()

    def join_simulated(self, part: str, library: object) -> None:
        """Reach the faults of a library from here, if it is a simulated one."""
        faults = getattr(library, "faults", None)
        if faults is not None:
            self.join(part, faults)

    @property
    def names(self) -> tuple[str, ...]:
        """What can be injected here, with the part's name before it: "camera frozen"."""
        return tuple(f"{part} {name}" for part in self._parts for name in FAULT_NAMES[part])

    @property
    def active(self) -> tuple[tuple[str, Any], ...]:
        """The faults in force, each with its part's name."""
        return tuple((name, each) for name, part in self._parts.items() for each in part.active)

    def inject(self, name: str, **where: Any) -> None:
        """Put a fault in force.

        Parameters
        ----------
        where
            Of a controller: `device`, `channel`, `delay_s`; of a board: `board`; of a camera:
            `camera`, `share`; of the scene: `tool`, `times`, `amount`.

        Raises
        ------
        ArgumentError
            There is no such fault here, or it cannot be there.
        """
        part, plain = self._find(name)
        try:
            part.inject(plain, **where)
        except TypeError:
            raise ArgumentError(f"fault {name!r} takes no {', '.join(where)}") from None

    def clear(self, name: str | None = None, **where: Any) -> None:
        """End a fault, or without a name all of them.

        Raises
        ------
        ArgumentError
            There is no such fault here.
        """
        if name is not None:
            part, plain = self._find(name)
            part.clear(plain, **where)
            return
        for part in self._parts.values():
            part.clear()

    def _find(self, name: str) -> tuple[_Part, str]:
        named, _, plain = str(name).partition(" ")
        if plain and named in self._parts and plain in FAULT_NAMES[named]:
            return self._parts[named], plain
        for part, names in FAULT_NAMES.items():
            if part in self._parts and name in names:
                return self._parts[part], name
        raise ArgumentError(f"there is no fault {name!r} here; known: {', '.join(self.names)}")


def make_scene(
    file: PlatformFile,
    path: Path,
    clock: Clock,
    *,
    seed: int,
    cold: bool,
    sample: str | None,
    truth: str | Path | None,
    world: str | None = None,
) -> Scene:
    """Return the scene that a platform file describes, with a sample on the plate.

    Parameters
    ----------
    sample : str or None
        Its name in twin.toml; None: the fibres that are listed there.
    truth : path or None
        Where to write what truly happens; nothing on the platform reads it back.
    world : str or None
        Its name; None: what the variable COSMIC_WORLD says, or twin.toml.

    Raises
    ------
    ConfigError
        The configuration is wrong, there is no such sample or world, or `truth` cannot be written.
    """
    twin = load_twin(file, path)
    name = world or os.environ.get(WORLD_VARIABLE) or twin.world
    drawn = load_world(name, path.parent)
    plates = Plates(drawn.applied(twin, seed), drawn, seed, sample)
    twin = plates.first()
    truth_log = NO_TRUTH if truth is None else TruthFile(Path(truth))
    try:
        return Scene.from_settings(
            twin,
            clock,
            seed,
            cold=cold,
            folder=path.parent,
            sample=sample or "",
            world=name,
            plates=plates,
            truth=truth_log,
            apart=True,
        )
    except BaseException:
        truth_log.close()
        raise
