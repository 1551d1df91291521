"""The simulated boards of a platform, and what is connected to their inputs."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

from typing_extensions import override

from cosmic.daqco.hw.board_checks import range_in_force
from cosmic.daqco.hw.interface import (
    BoardBackend,
    BoardContext,
    BoardInfo,
    BoardLibrary,
    InputSettings,
    Source,
)
from cosmic.daqco.hw.sim_board import SimulatedBoard
from cosmic.daqco.hw.sim_faults import BoardFaults
from cosmic.daqco.hw.sim_signal import BoardSignal, Signal
from cosmic.frame.clock import Clock
from cosmic.frame.errors import ConfigError, DeviceFault, NotConnectedError
from cosmic.frame.plugins import NoOptions

PCI_6229: Final = BoardInfo(
    name="Dev",
    product="PCI-6229",
    simulated=True,
    serial=0x0146_2290,
    inputs=tuple(f"ai{number}" for number in range(32)),
    max_single_rate_hz=250_000.0,
    max_multi_rate_hz=250_000.0,
    ranges_v=((-10.0, 10.0), (-5.0, 5.0), (-1.0, 1.0), (-0.2, 0.2)),
)


class SimulatedLibrary(BoardLibrary):
    """Simulated boards `Dev1`, `Dev2`, ..., PCI-6229 unless told otherwise; any thread.

    Parameters
    ----------
    clock : Clock
        Paces the samples: the platform's.
    sources : mapping of (str, str) to Source
        What is connected, by board and input, such as ``("Dev1", "ai0")``; every other input
        carries some millivolts of noise and hum.
    boards : int
        How many there are.
    info : BoardInfo
        What each is; names and serials are numbered from it.

    Attributes
    ----------
    faults : BoardFaults
        Trouble to inject by name.

    Raises
    ------
    ConfigError
        A source is connected where there is no input.
    """

    def __init__(
        self,
        clock: Clock,
        sources: Mapping[tuple[str, str], Source] | None = None,
        *,
        boards: int = 2,
        seed: int = 0,
        info: BoardInfo = PCI_6229,
    ) -> None:
        self._clock = clock
        self._sources = dict(sources or {})
        self._seed = seed
        self._infos = {
            each.name: each
            for each in (
                replace(info, name=f"Dev{number}", serial=info.serial + number)
                for number in range(1, boards + 1)
            )
        }
        self.faults = BoardFaults()
        self._owners: dict[str, SimulatedBoard] = {}
        self._receiver = clock.worker()
        for board, name in self._sources:
            if board not in self._infos or name not in self._infos[board].inputs:
                raise ConfigError(
                    f"a source is connected to {board}/{name}, but the simulated boards are "
                    f"{', '.join(self._infos)} with {info.inputs[0]} to {info.inputs[-1]}"
                )

    @property
    @override
    def name(self) -> str:
        return "Simulated boards"

    @override
    def list_boards(self) -> tuple[BoardInfo, ...]:
        if self.faults.hit("no_driver", ""):
            raise NotConnectedError(
                "the driver of the simulated boards is not installed (injected fault)",
                fault=DeviceFault.COMMUNICATION,
            )
        return tuple(
            info for name, info in self._infos.items() if not self.faults.hit("unplugged", name)
        )

    @override
    def open(self, name: str) -> SimulatedBoard:
        there = [info.name for info in self.list_boards()]
        if name not in there:
            raise NotConnectedError(
                f"there is no board {name!r}; there are: {', '.join(there) or 'none'}",
                fault=DeviceFault.COMMUNICATION,
            )
        info = self._infos[name]

        def make_signal(inputs: Sequence[InputSettings], chunk_samples: int) -> Signal:
            keys = [(name, each.input) for each in inputs]
            return BoardSignal(
                [range_in_force(info, each) for each in inputs],
                {row: self._sources[key] for row, key in enumerate(keys) if key in self._sources},
                rows=["/".join(key) for key in keys],
                chunk_samples=chunk_samples,
                seed=self._seed,
            )

        return SimulatedBoard(
            info,
            self._clock,
            self.faults,
            make_signal,
            owners=self._owners,
            receiver=self._receiver,
        )


def _make(_options: NoOptions, context: BoardContext) -> BoardLibrary:
    return SimulatedLibrary(context.clock, context.scene_sources, seed=context.seed)


BACKEND: Final = BoardBackend(_make, simulated=True)
