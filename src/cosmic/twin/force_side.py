"""The force side of the scene in one piece: tools, fibres, contact, force sensors."""

from collections.abc import Mapping
from pathlib import Path
from typing import Final

from cosmic.frame.arrays import Floats
from cosmic.twin.force_sensor import ForceSensor
from cosmic.twin.force_settings import FibreSettings
from cosmic.twin.guideways import Guideways
from cosmic.twin.kinematics import Point
from cosmic.twin.settings import TwinSettings
from cosmic.twin.stage import Stage
from cosmic.twin.timeline import Timeline
from cosmic.twin.tools import make_skeleton
from cosmic.twin.truth import NO_TRUTH, Truth
from cosmic.twin.twin_faults import TwinFaults
from cosmic.twin.workspace import Workspace

RIGID_UN_UM: Final = 1e9
"""Stiffness of a probe without a sensor."""


class ForceSide:
    """What touches what on the platform; any thread.

    Parameters
    ----------
    settings : TwinSettings
        Constants.
    folder : Path
        Of twin.toml.
    stages : mapping of str to Stage
        All stages by name.
    seed : int
        Of noise, drift and how fibres are held.
    faults : TwinFaults or None
        What is injected.
    truth : Truth
        Told what happens.

    Attributes
    ----------
    sensors : dict of str to ForceSensor
        As twin.toml names them. Reading one is all that an acquisition board may do here; the
        rest is the truth, for images, logs and tests.
    timeline : Timeline
        What was felt when, and all that touches and lies where, as it is worked out.
    offsets : ToolOffsets
        How far tools are from where the drawing has them.

    Raises
    ------
    ConfigError
        The URDF is missing, broken or does not fit the settings.
    """

    def __init__(
        self,
        settings: TwinSettings,
        folder: Path,
        stages: Mapping[str, Stage],
        seed: int,
        *,
        faults: TwinFaults | None = None,
        truth: Truth = NO_TRUTH,
    ) -> None:
        self._stages = stages
        self.skeleton = make_skeleton(settings, folder)
        on_probe = [each for each in settings.force_sensors.values() if each.mounted_on]
        stiffness = on_probe[0].stiffness_un_um if on_probe else RIGID_UN_UM
        self._workspace = Workspace(
            settings,
            self.skeleton,
            sensor_un_um=stiffness,
            seed=seed,
            faults=faults,
            truth=truth,
            folder=None if truth is NO_TRUTH else folder,
        )
        self.offsets = self._workspace.offsets
        self.guideways = Guideways(settings, seed)
        self.sensors = {
            name: ForceSensor(
                name,
                each,
                self._signal_un if each.mounted_on else None,
                seed,
                climate=self._workspace.climate,
            )
            for name, each in settings.force_sensors.items()
        }
        behind = [each for each in self.sensors.values() if each.settings.mounted_on]
        self.timeline = Timeline(
            self._workspace,
            stages,
            settings.contact.step_s,
            guideways=self.guideways,
            sense=behind[0].transducer.signal_un if behind else None,
        )

    def _signal_un(self, times_s: Floats) -> Floats:
        return self.timeline.signal_un(times_s)

    def check_plate_change(self, now_s: float) -> None:
        """Check that the plate can be taken away now.

        Raises
        ------
        NotAvailable
            Something is held, or jaws stand too low.
        """
        self.timeline.change(now_s, self._workspace.check_plate_change)

    def change_plate(self, now_s: float, number: int, fibres: tuple[FibreSettings, ...]) -> None:
        """Take everything off the plate, and put another with other fibres there.

        Raises
        ------
        NotAvailable
            Something is held, or jaws stand too low.
        """

        def change(values: Mapping[str, float]) -> None:
            self._workspace.change_plate(values, number, fibres)

        self.timeline.change(now_s, change)

    def tips(self, now_s: float) -> dict[str, Point]:
        """Return where the tips of the tools are, um, world; see `Workspace.tips`."""
        return self._workspace.tips(self.positions(now_s), now_s)

    def positions(self, at_s: float) -> dict[str, float]:
        """Return where stages are led to at a moment, in their units; play and lag are not seen."""
        values = {name: each.position_then(at_s) for name, each in self._stages.items()}
        return values if self.guideways.true else self.guideways.led(values)
