"""Cameras that Aravis drives: its fake GigE camera in a process of its own, and the one inside."""

from typing import Self

from typing_extensions import override

from contract.cameras import CameraRig, Can
from contract.cameras.gige_process import GigeCamera, missing
from cosmic.vico.hw.aravis import AravisLibrary
from cosmic.vico.hw.interface import Roi


class GigeRig(CameraRig):
    """A GigE Vision camera on loopback; beside it runs the one without a network."""

    name = "aravis-gige"
    two = True
    can = frozenset(Can)
    other_key = "Fake_1"
    rate_hz = 60.0
    roi = Roi(0, 0, 320, 240)

    @override
    @classmethod
    def missing(cls) -> str:
        return missing()

    @override
    def __enter__(self) -> Self:
        self._camera = GigeCamera("CONTRACT").__enter__()
        self.key = self._camera.key
        self.library = AravisLibrary(self.clock, fake=True)
        return self

    @override
    def __exit__(self, *exc: object) -> None:
        self.library.close()
        self._camera.__exit__(*exc)

    @override
    def unplug(self) -> None:
        self._camera.kill()

    @override
    def plug_in(self) -> None:
        self._camera.start()


RIGS = (GigeRig,)
