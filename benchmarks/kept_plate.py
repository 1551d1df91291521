"""The plate of a simulated platform that is started again and again, as a real one would lie there.

The twin forgets everything with its process. Here its file of truth tells what became of each
fibre, and the next start finds them so: on the plate where they fell, in the closed jaws, or gone.
"""

import math
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import tomlkit

from cosmic.frame.config import load_model, shipped_config_dir
from cosmic.twin.centre_line import CentreLine
from cosmic.twin.force_settings import FibreSettings
from cosmic.twin.sample_layout import put_on
from cosmic.twin.settings import TwinSettings
from cosmic.twin.truth import TruthEvent, read_truth

GRIPPER: Final = "left"
TIGHTER_UM: Final = 2.0
KEYS: Final = ("x_um", "y_um", "angle_deg", "held_by", "free_um")


@dataclass(frozen=True, slots=True)
class Grasp:
    """A fibre was taken up.

    Attributes
    ----------
    fibre : int
        Its number in the sample, which stays with it.
    time_s : float
        On the clock of its life of the platform.
    """

    fibre: int
    time_s: float


class KeptPlate:
    """What lies on the plate, from one life of the platform to the next.

    Attributes
    ----------
    fibres : dict of int to FibreSettings
        Those that are not gone, by their numbers.
    """

    def __init__(self, sample: str, seed: int) -> None:
        self._twin = load_model(shipped_config_dir() / "twin.toml", TwinSettings)
        put = put_on(self._twin, sample, seed)
        self._gap_um = put.stages[f"{GRIPPER}.gripper"].start
        self._faults = put.handling.default_faults
        self.fibres = dict(enumerate(put.fibres))
        self._order: list[int] = []

    @property
    def held(self) -> FibreSettings | None:
        """What hangs in the jaws."""
        return next((each for each in self.fibres.values() if each.held_by), None)

    def write(self, folder: Path, *, cold: bool) -> Path:
        """Write a configuration with the plate as it is, and return its folder.

        Cold, the power was off as well: grippers stand open, and what was held fell off.
        """
        if cold:
            self.fibres = {
                number: each.model_copy(update={"held_by": "", "free_um": 0.0})
                for number, each in self.fibres.items()
            }
        shutil.copytree(shipped_config_dir(), folder, dirs_exist_ok=True)
        path = folder / "twin.toml"
        document: Any = tomlkit.parse(path.read_text(encoding="utf-8"))
        self._order = sorted(self.fibres)
        tables = tomlkit.aot()
        for number in self._order:
            table = tomlkit.table()
            table.update(self.fibres[number].model_dump(exclude={"bonded_to"}))
            tables.append(table)
        document["fibres"] = tables
        document["handling"]["default_faults"] = self._faults
        for gripper in self._twin.geometry.grippers.values():
            document["stages"][gripper.stage]["start"] = self._gap_um
        held = self.held
        if held is not None:
            document["stages"][f"{held.held_by}.gripper"]["start"] = held.width_um - TIGHTER_UM
        path.write_text(tomlkit.dumps(document), encoding="utf-8")
        return folder

    def live(self, truth: Path) -> list[Grasp]:
        """Take what happened in a life of the platform, and return what was taken up in it."""
        grasps: list[Grasp] = []
        for event in read_truth(truth).events:
            local = event.facts.get("fibre")
            if not isinstance(local, int):
                continue
            if local >= len(self._order):  # a piece that broke off is not followed further
                continue
            number = self._order[local]
            if event.event == "grasped":
                grasps.append(Grasp(number, event.time_s))
            self._note(number, event)
        return grasps

    def _note(self, number: int, event: TruthEvent) -> None:
        fibre, facts = self.fibres.get(number), event.facts
        if fibre is None:
            return
        if event.event == "grasped":
            held = {"held_by": facts["tool"], "free_um": facts["free_um"]}
            self.fibres[number] = fibre.model_copy(update=held)
        elif event.event == "landed":
            self.fibres[number] = _lying(fibre, facts["x_um"], facts["y_um"], facts["angle_deg"])
        elif event.event in ("gone", "broken"):
            del self.fibres[number]


def _lying(fibre: FibreSettings, x_um: float, y_um: float, angle_deg: float) -> FibreSettings:
    """Return a fibre with the mean of its points at a place."""
    line = CentreLine.of(fibre.length_um, fibre.curl_deg, fibre.kink_deg)
    middle = line.placed(0.0, 0.0, math.radians(angle_deg)).mean(axis=0)
    return fibre.model_copy(
        update={
            "held_by": "",
            "free_um": 0.0,
            "x_um": x_um - float(middle[0]),
            "y_um": y_um - float(middle[1]),
            "angle_deg": angle_deg,
        }
    )
