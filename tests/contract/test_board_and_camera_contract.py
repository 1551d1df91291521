"""Our own boards and cameras under the suites that other packages import."""

from collections.abc import Callable

from contract.board_rig import NidaqmxRig, SimulatedRig
from contract.cameras.simulated import RIGS
from cosmic.daqco.hw.interface import BoardLibrary
from cosmic.testing.boards import BoardContract
from cosmic.testing.cameras import CameraContract
from cosmic.vico.hw.interface import CameraLibrary


class TestSimulatedBoards(BoardContract):
    def make_library(self) -> tuple[BoardLibrary, Callable[[float], None]]:
        rig = SimulatedRig()
        return rig.library, rig.clock.advance


class TestBoardsOfNationalInstruments(BoardContract):
    def make_library(self) -> tuple[BoardLibrary, Callable[[float], None]]:
        rig = NidaqmxRig()
        return rig.library, lambda seconds: rig.go_on(round(seconds * 1000.0))


class TestSimulatedCameras(CameraContract):
    def make_library(self) -> CameraLibrary:
        return RIGS[0]().__enter__().library
