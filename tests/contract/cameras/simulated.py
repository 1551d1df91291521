"""The simulated cameras: views of the twin."""

from typing import Self

from typing_extensions import override

from contract.cameras import CameraRig, Can
from cosmic.twin.scene import Scene
from cosmic.twin.settings import shipped_settings
from cosmic.vico.hw.interface import Roi
from cosmic.vico.hw.sim_camera import SimulatedCameraLibrary


class SimulatedRig(CameraRig):
    """The microscope and the overview of the shipped twin."""

    name = "simulated"
    two = True
    can = frozenset(Can)
    key = "Sim1"
    other_key = "Sim2"
    rate_hz = 60.0
    roi = Roi(640, 500, 160, 120)
    library: SimulatedCameraLibrary

    @override
    def __enter__(self) -> Self:
        scene = Scene.from_settings(shipped_settings(), self.clock)
        self.library = SimulatedCameraLibrary(scene, self.clock)
        return self

    @override
    def unplug(self) -> None:
        self.library.faults.inject("unplugged", camera=self.key)

    @override
    def plug_in(self) -> None:
        self.library.faults.clear("unplugged")


RIGS = (SimulatedRig,)
