"""The simulated boards of a platform, and what is connected to their inputs."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final, Literal

from pydantic import Field
from typing_extensions import override

from cosmic.daqco.hw.board_checks import range_in_force
from cosmic.daqco.hw.interface import (
    BoardBackend,
    BoardContext,
    BoardInfo,
    BoardLibrary,
    InputMode,
    InputSettings,
    Source,
)
from cosmic.daqco.hw.sim_board import Pieces, SimulatedBoard
from cosmic.daqco.hw.sim_faults import BoardFaults
from cosmic.daqco.hw.sim_outputs import OutputLevel, SimulatedOutputs, Terminals
from cosmic.daqco.hw.sim_signal import BoardSignal, Signal
from cosmic.frame.clock import Clock
from cosmic.frame.config import StrictModel
from cosmic.frame.errors import ConfigError, DeviceFault, NotConnectedError
from cosmic.twin.trigger_line import TriggerLine

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
ANALOG_OUTPUTS: Final = 2
LINES: Final = 8
_T7_INPUTS: Final = tuple(f"ai{number}" for number in range(14))
T7: Final = BoardInfo(
    name="Dev",
    product="T7",
    simulated=True,
    serial=470_010_000,
    inputs=_T7_INPUTS,
    max_single_rate_hz=100_000.0,
    max_multi_rate_hz=100_000.0,
    ranges_v=((-10.0, 10.0), (-1.0, 1.0), (-0.1, 0.1), (-0.01, 0.01)),
    modes=(InputMode.RSE, InputMode.DIFFERENTIAL),
    pairs=tuple(zip(_T7_INPUTS[::2], _T7_INPUTS[1::2], strict=True)),
)


class SimulatedOptions(StrictModel):
    """What the configuration may say under ``options``.

    Attributes
    ----------
    name : str
        What the boards are called, before their number.
    clock_ppm : float
        How much faster than it says the sample clock of these boards runs, in parts of a million.
    wires : dict of str to str
        From an analogue output to an input: ``{"Dev1/ao0": "Dev1/ai7"}``.
    """

    product: Literal["PCI-6229", "T7"] = "PCI-6229"
    boards: int = Field(default=2, ge=1, le=16)
    name: str = Field(default=PCI_6229.name, pattern=r"^[A-Za-z][A-Za-z0-9_]*$")
    clock_ppm: float = Field(default=0.0, ge=-1000.0, le=1000.0)
    wires: dict[str, str] = Field(default_factory=dict)


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
    clock_ppm : float
        How much faster than they say their sample clock runs, in parts of a million.
    wires : mapping of str to str, or None
        From analogue outputs to inputs, such as ``{"Dev1/ao0": "Dev1/ai7"}``.
    start_triggers : mapping of str to str, or None
        Terminal whose rising edge starts a board.
    trigger_lines : mapping of str to TriggerLine, or None
        What is connected to counters, by board and counter: "Dev1/ctr0".

    Attributes
    ----------
    faults : BoardFaults
        Trouble to inject by name.
    terminals : Terminals
        Where triggers come in, such as "/Dev1/PFI0".

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
        clock_ppm: float = 0.0,
        wires: Mapping[str, str] | None = None,
        start_triggers: Mapping[str, str] | None = None,
        trigger_lines: Mapping[str, TriggerLine] | None = None,
    ) -> None:
        self._clock = clock
        self._clock_ppm = clock_ppm
        self._start_triggers = dict(start_triggers or {})
        self._trigger_lines = dict(trigger_lines or {})
        self._sources = dict(sources or {})
        self._seed = seed
        self._infos = {
            each.name: each
            for each in (
                replace(info, name=f"{info.name}{number}", serial=info.serial + number)
                for number in range(1, boards + 1)
            )
        }
        self.faults = BoardFaults()
        self._owners: dict[str, SimulatedBoard] = {}
        self._receiver = clock.worker()
        self._pieces = Pieces()
        self.terminals = Terminals()
        self._levels = {
            name: {f"ao{number}": OutputLevel() for number in range(ANALOG_OUTPUTS)}
            for name in self._infos
        }
        self._lines = {
            name: {f"port0/line{number}": False for number in range(LINES)} for name in self._infos
        }
        for output, place in (wires or {}).items():
            self._wire(output, place)
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
            pieces=self._pieces,
            clock_ppm=self._clock_ppm,
            terminals=self.terminals,
            start_trigger=self._start_triggers.get(name, ""),
            trigger_lines=self._trigger_lines,
        )

    def open_outputs(self, board: str) -> SimulatedOutputs:
        """Return the outputs of a board; raises `NotConnectedError` where there is none."""
        if board not in [info.name for info in self.list_boards()]:
            raise NotConnectedError(f"there is no board {board!r}", fault=DeviceFault.COMMUNICATION)
        return SimulatedOutputs(
            self._infos[board],
            self._clock,
            self.faults,
            self.terminals,
            levels=self._levels[board],
            lines=self._lines[board],
        )

    def _wire(self, output: str, place: str) -> None:
        board, _, name = output.partition("/")
        where, _, into = place.partition("/")
        if name not in self._levels.get(board, {}):
            raise ConfigError(f"wires: there is no analogue output {output!r}")
        self._sources[where, into] = self._levels[board][name]

    def output_level(self, board: str, output: str) -> OutputLevel:
        """Return what an analogue output gives, as a voltmeter would read it."""
        return self._levels[board][output]

    def line_is_high(self, board: str, line: str) -> bool:
        """Return the state of a digital line."""
        return self._lines[board][line]


def _make(options: SimulatedOptions, context: BoardContext) -> BoardLibrary:
    info = replace(T7 if options.product == "T7" else PCI_6229, name=options.name)
    sources = dict(context.scene_sources or {})
    if options.name != PCI_6229.name:
        # A second make beside those that the twin's sensors are wired to.
        sources = {key: each for key, each in sources.items() if key[0].startswith(options.name)}
    return SimulatedLibrary(
        context.clock,
        sources,
        boards=options.boards,
        seed=context.seed,
        info=info,
        clock_ppm=options.clock_ppm,
        wires=options.wires,
        start_triggers=context.start_triggers,
        trigger_lines=context.trigger_lines,
    )


BACKEND: Final = BoardBackend(_make, options=SimulatedOptions, simulated=True, twin=True)
