"""An application that is not there: does what its widgets ask and remembers it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from cosmic.daqco.api.files import NamedFile, named_file, recordings_in
from cosmic.daqco.core.chunk import DataChunk
from cosmic.daqco.core.output_control import OutputState
from cosmic.daqco.core.settings import (
    COLOURS,
    ChannelSettings,
    DaqcoSettings,
    LimitSettings,
    ScaleSettings,
)
from cosmic.daqco.hw.interface import BoardInfo
from cosmic.frame.errors import ConfigError, CosmicError
from cosmic.frame.file_names import directory_problem
from cosmic.frame.operation import Task

FORCE = ScaleSettings(name="Probe", unit="uN", coefficients=(0.0, 20.0))
INPUTS = tuple(f"ai{number}" for number in range(32))


def board(name: str = "Dev1") -> BoardInfo:
    return BoardInfo(
        name=name,
        product="PCI-6229",
        simulated=True,
        serial=1,
        inputs=INPUTS,
        max_single_rate_hz=250_000.0,
        max_multi_rate_hz=250_000.0,
        ranges_v=((-10.0, 10.0), (-5.0, 5.0)),
    )


def channel(number: int, **changes: object) -> ChannelSettings:
    given: dict[str, object] = {
        "name": f"channel{number}",
        "board": "Dev1" if number < 32 else "Dev2",
        "input": f"ai{number % 32}",
        "colour": COLOURS[number % len(COLOURS)],
    }
    return ChannelSettings.model_validate(given | changes)


def settings(**changes: object) -> DaqcoSettings:
    given: dict[str, object] = {
        "rate_hz": 1000.0,
        "scale": (FORCE,),
        "channel": (
            channel(0, name="force", scale="Probe"),
            channel(1, name="light"),
            channel(2, name="spare", active=False),
        ),
    }
    return DaqcoSettings.model_validate(given | changes)


def many(count: int, rate_hz: float = 15_000.0) -> DaqcoSettings:
    return settings(rate_hz=rate_hz, channel=tuple(channel(number) for number in range(count)))


@dataclass(frozen=True)
class Counted:
    samples: int = 0
    lost: int = 0
    backlog: int = 0


@dataclass(frozen=True)
class Recorded:
    active: bool = False
    path: Path | None = None
    duration_s: float = 0.0
    size_bytes: int = 0
    failure: str = ""


@dataclass(frozen=True)
class Limited:
    settings: LimitSettings
    crossed: bool = False
    value: float | None = None
    reaction_ms: float | None = None
    reason: str = ""


class FakePort:
    """Follows `DaqPort`; tests push samples with `push` and set what it is to answer."""

    def __init__(self, given: DaqcoSettings, directory: Path = Path()) -> None:
        self.settings = given
        self.running = True
        self.problem = ""
        self.away = ""
        self.remote = ""
        self.outputs: tuple[OutputState, ...] = ()
        self.outputs_stopped = ""
        self.counters = Counted()
        self.recording = Recorded()
        self.limits: tuple[Limited, ...] = tuple(Limited(each) for each in given.limit)
        self.directory = directory
        self.free = 10**12
        self.refuse: str = ""
        self.fail_close: str = ""
        self.known = (board(), board("Dev2"))
        self.calls: list[tuple[object, ...]] = []
        self.export_task: Task | None = None
        self._receivers: list[Callable[[DataChunk], object]] = []
        self._listeners: list[Callable[[], object]] = []
        self.next_sample = 0

    # listening

    @property
    def rate_hz(self) -> float:
        return self.settings.rate_hz

    def carry_out(self, action, on_result, *, slow=False) -> None:
        try:
            result = action()
        except CosmicError as exc:
            on_result(None, exc)
        else:
            on_result(result, None)

    def folder_problem(self, directory: str) -> str:
        return directory_problem(directory)

    def name_recording(self, base, option, directory, when) -> NamedFile:
        return named_file(base, option, directory, when)

    def follow(self, receiver: Callable[[DataChunk], object]) -> Callable[[], None]:
        self._receivers.append(receiver)
        return lambda: self._receivers.remove(receiver)

    def on_change(self, listener: Callable[[], object]) -> Callable[[], None]:
        self._listeners.append(listener)
        return lambda: self._listeners.remove(listener)

    @property
    def listened(self) -> int:
        return len(self._receivers) + len(self._listeners)

    def change(self, **changes: object) -> None:
        for name, value in changes.items():
            setattr(self, name, value)
        for listener in list(self._listeners):
            listener()

    # samples

    def push(self, volts: np.ndarray, *, lost_before: int = 0) -> DataChunk:
        """Acquire volts, shape (active channels, n)."""
        active = [each for each in self.settings.channel if each.active]
        scales = self.settings.scales()
        self.next_sample += lost_before
        chunk = DataChunk(
            first_sample=self.next_sample,
            time_s=self.next_sample / self.rate_hz,
            rate_hz=self.rate_hz,
            channels=tuple(each.name for each in active),
            volts=np.array(volts, dtype=np.float64),
            scales=tuple(scales[each.scale] for each in active),
        )
        self.next_sample += chunk.samples
        for receiver in list(self._receivers):
            receiver(chunk)
        return chunk

    # acquisition

    def boards(self) -> Sequence[BoardInfo]:
        return self.known

    def highest_rate_hz(self, channels: Sequence[ChannelSettings]) -> float:
        rates = [
            each.highest_rate_hz(sum(c.active and c.board == each.name for c in channels))
            for each in self.known
        ]
        return min([15_000.0, *rates])

    def _do(self, *call: object) -> None:
        if self.refuse:
            raise CosmicError(self.refuse)
        self.calls.append(call)

    def start(self) -> None:
        self._do("start")
        self.change(running=True)

    def stop(self) -> None:
        self._do("stop")
        self.change(running=False)

    def apply(self, given: DaqcoSettings) -> None:
        self._do("apply", given)
        self.next_sample = 0
        self.change(settings=given)

    # outputs

    def _give(self, name: str, value: float, *call: object) -> None:
        self._do(*call)
        self.change(
            outputs=tuple(
                replace(each, value=value) if each.name == name else each for each in self.outputs
            )
        )

    def set_output(self, name: str, volts: float) -> None:
        self._give(name, volts, "set output", name, volts)

    def set_line(self, name: str, *, high: bool) -> None:
        self._give(name, float(high), "set line", name, high)

    def stop_outputs(self) -> None:
        self._do("stop outputs")
        self.change(outputs_stopped="stop of the outputs")

    def reset_outputs(self) -> None:
        self._do("reset outputs")
        self.change(outputs_stopped="")

    # recording

    def start_recording(self, path: Path, *, overwrite: bool = False) -> None:
        if path.exists() and not overwrite:
            raise ConfigError(f"{path} exists")
        self._do("record", path, overwrite)
        path.write_bytes(b"")
        self.change(recording=Recorded(active=True, path=path))

    def stop_recording(self) -> None:
        self._do("stop recording")
        if self.fail_close:
            self.change(recording=replace(self.recording, active=False, failure=self.fail_close))
            raise CosmicError(self.fail_close)
        self.change(recording=replace(self.recording, active=False))

    def free_bytes(self, directory: Path) -> int:
        if not directory.is_dir():
            raise ConfigError(f"{directory}: there is no such directory")
        return self.free

    def recordings(self, directory: Path) -> tuple[Path, ...]:
        return recordings_in(directory)

    def export(self, source: Path, target: Path) -> Task:
        self._do("export", source, target)
        self.export_task = Task(f"Export to {target.name}")
        return self.export_task

    # limits

    def set_limit(self, limit: LimitSettings) -> None:
        self._do("limit", limit)
        others = [each for each in self.limits if each.settings.channel != limit.channel]
        self.change(limits=(*others, Limited(limit)))

    def remove_limit(self, channel: str) -> None:
        self._do("remove limit", channel)
        self.change(limits=tuple(x for x in self.limits if x.settings.channel != channel))

    def reset_limit(self, channel: str) -> None:
        self._do("reset limit", channel)
        self.change(
            limits=tuple(
                Limited(x.settings) if x.settings.channel == channel else x for x in self.limits
            )
        )
