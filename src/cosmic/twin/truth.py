"""What truly happened, written to a file that nothing on the platform reads back.

Lines of JSON: the first tells the sample, each further one an event with its time on the
platform's clock. Code that controls the platform has no way to it; who scores a run reads the file
afterwards with `read_truth`.
"""

import json
from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from threading import Lock
from typing import Any, Final, Protocol, TextIO

from typing_extensions import override

from cosmic.frame.errors import ConfigError
from cosmic.twin.force_settings import FibreSettings

FORMAT: Final = 1


class Truth(Protocol):
    """Whoever is told what truly happens; any thread."""

    @abstractmethod
    def record(self, time_s: float, event: str, **facts: object) -> None:
        """Take note of an event."""

    @abstractmethod
    def close(self) -> None:
        """End; nothing is told afterwards."""


class NoTruth(Truth):
    """Nobody listens."""

    @override
    def record(self, time_s: float, event: str, **facts: object) -> None:
        """Forget it."""

    @override
    def close(self) -> None:
        """Nothing is open."""


NO_TRUTH: Final = NoTruth()


class TruthFile(Truth):
    """Writes each event as a line, at once.

    Parameters
    ----------
    path : Path
        A new file. One of an earlier run is kept beside it, with a number in its name.

    Raises
    ------
    ConfigError
        It cannot be written, or something else is there.
    """

    def __init__(self, path: Path) -> None:
        self._lock = Lock()
        try:
            _make_room(path)
            self._file: TextIO | None = path.open("x", encoding="utf-8")
        except OSError as exc:
            raise ConfigError(f"{path}: cannot be written: {exc.strerror or exc}") from exc

    @override
    def record(self, time_s: float, event: str, **facts: object) -> None:
        line = json.dumps({"time_s": round(time_s, 6), "event": event, **facts}, default=_rounded)
        with self._lock:
            if self._file is not None:
                self._file.write(f"{line}\n")
                self._file.flush()

    @override
    def close(self) -> None:
        with self._lock:
            if self._file is not None:
                self._file.close()
                self._file = None


def _make_room(path: Path) -> None:
    """Rename the truth of an earlier run; raises `ConfigError` where there is anything else."""
    if not path.exists():
        return
    if not path.is_file():
        raise ConfigError(f"{path}: is not a file; give the name of a new one")
    with path.open("rb") as file:
        begin = file.read(1000)
    if begin.strip() and not begin.startswith(b'{"time_s":'):
        raise ConfigError(
            f"{path}: exists and is not a file of the twin's truth; give another name"
        )
    if not begin.strip():
        path.unlink()
        return
    taken = (path.with_name(f"{path.stem}-{number}{path.suffix}") for number in count(1))
    path.rename(next(each for each in taken if not each.exists()))


def _rounded(value: object) -> object:
    return str(value)


@dataclass(frozen=True, slots=True)
class TruthEvent:
    """One thing that happened.

    Attributes
    ----------
    facts : mapping of str to value
        What belongs to it; docs/explanation/twin.md lists them by event.
    """

    time_s: float
    event: str
    facts: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class TrueFibre:
    """One fibre as it was when its plate came; lengths in um, on the plate.

    Attributes
    ----------
    ei_n_m2 : float
        Flat way, at 50 % humidity; what a push is really about stands in its event "touched".
    """

    number: int
    length_um: float
    width_um: float
    ei_n_m2: float
    curl_deg: float
    kink_deg: float
    x_um: float
    y_um: float
    angle_deg: float
    role: str


@dataclass(frozen=True, slots=True)
class TruthRecord:
    """A whole file of truth.

    Attributes
    ----------
    sample : str
        Its name; "" for the fibres that twin.toml lists.
    fibres : tuple of TrueFibre
        Of all plates.
    world : str
        "" in files from before there were worlds.
    complete : bool
        The platform was closed in order.
    """

    sample: str
    seed: int
    fibres: tuple[TrueFibre, ...]
    world: str
    events: tuple[TruthEvent, ...]
    complete: bool

    def of(self, event: str, fibre: int | None = None) -> tuple[TruthEvent, ...]:
        """Return the events of one name, of one fibre or of all."""
        return tuple(
            each
            for each in self.events
            if each.event == event and fibre in (None, each.facts.get("fibre"))
        )


def record_sample(
    truth: Truth, sample: str, seed: int, fibres: tuple[FibreSettings, ...], world: str = ""
) -> None:
    """Tell what lies on the plate at the start."""
    table = _table(0, fibres)
    truth.record(0.0, "sample", format=FORMAT, sample=sample, seed=seed, world=world, fibres=table)


def record_plate(
    truth: Truth, time_s: float, number: int, begin: int, fibres: tuple[FibreSettings, ...]
) -> None:
    """Tell what lies on a new plate; its first fibre has the number `begin`."""
    truth.record(time_s, "plate", plate=number, fibres=_table(begin, fibres))


def _table(begin: int, fibres: tuple[FibreSettings, ...]) -> list[dict[str, object]]:
    names = TrueFibre.__slots__[1:]
    return [
        {"number": begin + place, **{name: getattr(each, name) for name in names}}
        for place, each in enumerate(fibres)
    ]


def read_truth(path: str | Path) -> TruthRecord:
    """Read a file of truth, for scoring; a last line cut short is left out.

    Raises
    ------
    ConfigError
        The file is missing, or is none of these.
    """
    try:
        lines = Path(path).read_text(encoding="utf-8").splitlines()
    except OSError as exc:
        raise ConfigError(f"{path}: cannot be read: {exc.strerror or exc}") from exc
    found = [entry for line in lines if (entry := _entry(line)) is not None]
    if not found or found[0].get("event") != "sample" or found[0].get("format") != FORMAT:
        raise ConfigError(f"{path}: not a file of the twin's truth, format {FORMAT}")
    head, *rest = found
    events = tuple(
        TruthEvent(
            each["time_s"],
            each["event"],
            {key: value for key, value in each.items() if key not in ("time_s", "event")},
        )
        for each in rest
    )
    return TruthRecord(
        sample=head["sample"],
        seed=head["seed"],
        fibres=tuple(
            TrueFibre(**each)
            for table in (head, *(each for each in rest if each["event"] == "plate"))
            for each in table["fibres"]
        ),
        world=head.get("world", ""),
        events=events,
        complete=bool(events) and events[-1].event == "end",
    )


def _entry(line: str) -> dict[str, Any] | None:
    try:
        entry = json.loads(line)
    except json.JSONDecodeError:
        return None
    return entry if isinstance(entry, dict) and "time_s" in entry and "event" in entry else None
