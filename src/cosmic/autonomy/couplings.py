"""Couplings of an input device with MiCo and DAQCo (thesis 6.3, Fig. 6.16).

As in the thesis each converter runs in the thread of the sender or the receiver of its data, and
nothing else takes part at run time: `TestAppMiCoConverter` in the input thread,
`TestAppDAQCoConverter` in the acquisition thread.
"""

import logging
import math
from collections.abc import Callable, Mapping
from threading import Lock
from typing import Final

from typing_extensions import override

from cosmic.autonomy.interlocks import MICRONEWTONS
from cosmic.daqco.api.application import DaqcoApplication
from cosmic.daqco.core.chunk import DataChunk
from cosmic.daqco.core.settings import DaqcoSettings
from cosmic.frame.clock import WALL
from cosmic.frame.errors import NotAvailable
from cosmic.mico.api.mico import Mico
from cosmic.mico.core.teleoperation.coupling import ForceCoupling
from cosmic.mico.core.teleoperation.mapping import Converter
from cosmic.mico.core.teleoperation.settings import TeleoperationSettings
from cosmic.mico.hw.input_device import InputState

logger = logging.getLogger(__name__)

STALE_S: Final = 0.1
"""Age from which a force no longer counts as an answer, on the wall clock."""
RISE_UN: Final = 1.0
"""By how much a force must rise before the movements under way are held to be the reason."""
LAG_S: Final = 0.15
"""How long after a movement turned the force may still rise from what it did before."""


class TestAppDAQCoConverter:
    """Turns chunks of samples into the force that the hand feels, and into a limit of its speed.

    Parameters
    ----------
    feel : callable
        Takes the force by axis of the device, -1 to 1; returns at once.
    acquiring : callable
        Whether samples are expected now.
    """

    __test__ = False  # a name of the thesis, no test

    def __init__(
        self,
        settings: TeleoperationSettings,
        feel: Callable[[Mapping[str, float]], None],
        acquiring: Callable[[], bool],
    ) -> None:
        self._settings = settings
        self._feel = feel
        self._acquiring = acquiring
        self._lock = Lock()
        self._force_un = 0.0
        self._taken_wall_s = -math.inf
        self._started_wall_s = WALL.now_s()
        self._blamed: dict[str, int] = {}
        self._blamed_at_un = 0.0
        self._since: dict[str, tuple[int, float]] = {}
        self._chunks = 0

    @property
    def force_un(self) -> float:
        """The force of the last chunk."""
        return self._force_un

    @property
    def chunks(self) -> int:
        """How many chunks were handed on."""
        return self._chunks

    def restart(self) -> None:
        """Forget what was felt before."""
        with self._lock:
            self._blamed, self._blamed_at_un = {}, 0.0
            self._started_wall_s = WALL.now_s()

    def take(self, chunk: DataChunk) -> None:
        """Hand the newest force on; acquisition thread, once a chunk."""
        settings = self._settings
        if settings.force_channel not in chunk.channels:
            return
        row = chunk.channels.index(settings.force_channel)
        scale = chunk.scales[row]
        # What is no force is no number here, and lets nothing go on.
        factor = MICRONEWTONS.get(scale.unit, math.nan)
        force_un = factor * float(scale.apply(chunk.volts[row]).mean())
        self._force_un, self._taken_wall_s = force_un, WALL.now_s()
        share = force_un / settings.feedback_un * settings.force_direction
        # A value that is no number is no force, and nothing to push a hand with.
        share = max(-1.0, min(1.0, share)) if math.isfinite(share) else 0.0
        self._chunks += 1
        self._feel({settings.force_axis: share})

    @property
    def share(self) -> float:
        """Part of the speed that the force leaves to movements that raise it."""
        settings = self._settings
        if not settings.force_channel or not self._acquiring():
            return 1.0
        if not WALL.now_s() - max(self._taken_wall_s, self._started_wall_s) <= STALE_S:
            return 0.0  # samples are expected and stay away: the force may be anything
        if self._taken_wall_s == -math.inf:
            return 1.0
        over_un = abs(self._force_un) - settings.soft_force_un
        share = 1.0 - over_un / (settings.hard_force_un - settings.soft_force_un)
        return max(0.0, min(1.0, share)) if math.isfinite(share) else 0.0

    def slow_down(self, velocities: Mapping[str, float]) -> dict[str, float]:
        """Slow down what raises the force; the way back stays free. Input thread.

        While the force rises beyond its soft limit, the directions under way are held to be the
        reason; every other direction is slowed down as well, but for the opposite of these.
        """
        share, force_un = self.share, abs(self._force_un)
        with self._lock:
            moving, settled = self._moving(velocities)
            if share >= 1.0:
                self._blamed, self._blamed_at_un = moving or self._blamed, force_un
                return dict(velocities)
            if not self._blamed:
                self._blamed, self._blamed_at_un = moving, force_un
            elif force_un > self._blamed_at_un + RISE_UN:
                self._blamed.update(settled)
                self._blamed_at_un = force_un
            blamed = dict(self._blamed)
        return {
            name: velocity if velocity * blamed.get(name, 0) < 0.0 else share * velocity
            for name, velocity in velocities.items()
        }

    def _moving(self, velocities: Mapping[str, float]) -> tuple[dict[str, int], dict[str, int]]:
        """Return the directions under way, and those of them that are for some time."""
        now_s = WALL.now_s()
        before = self._since
        self._since = {}
        for name, velocity in velocities.items():
            if velocity != 0.0:
                direction = 1 if velocity > 0.0 else -1
                same = name in before and before[name][0] == direction
                self._since[name] = before[name] if same else (direction, now_s)
        moving = {name: direction for name, (direction, _) in self._since.items()}
        settled = {
            name: direction
            for name, (direction, since_s) in self._since.items()
            if now_s - since_s >= LAG_S
        }
        return moving, settled


class TestAppMiCoConverter(Converter):
    """Turns what an input device says into movements of positioners, no faster than felt.

    Parameters
    ----------
    mapping : Converter
        What the inputs move.
    force : TestAppDAQCoConverter
        What the force leaves of it.
    """

    __test__ = False  # a name of the thesis, no test

    def __init__(self, mapping: Converter, force: TestAppDAQCoConverter) -> None:
        self._mapping = mapping
        self._force = force

    @override
    def convert(self, inputs: InputState, *, fine: bool) -> dict[str, float]:
        return self._force.slow_down(self._mapping.convert(inputs, fine=fine))


def join_teleoperation(mico: Mico, daqco: DaqcoApplication) -> TestAppDAQCoConverter:
    """Have the hand that steers feel the force, and be slowed down by it.

    Chunks are taken while something is steered; returns what takes them.
    """
    teleoperation = mico.teleoperation
    wanted = teleoperation.settings.force_channel
    ends: list[Callable[[], None]] = []
    chunks_before = 0

    def expected() -> bool:
        """Return whether samples are due; a board that is lost while steering still owes them."""
        lost = bool(daqco.problem) and force.chunks > chunks_before
        return daqco.running or lost

    force = TestAppDAQCoConverter(teleoperation.settings, teleoperation.feel, expected)

    def begin() -> None:
        nonlocal chunks_before
        chunks_before = force.chunks
        force.restart()
        if wanted:
            ends.append(daqco.buffer.subscribe(force.take))

    def end() -> None:
        while ends:
            ends.pop()()

    teleoperation.coupling = ForceCoupling(
        make_converter=lambda mapping: TestAppMiCoConverter(mapping, force),
        begin=begin,
        end=end,
        slowed=lambda: force.share,
        problem=lambda: _missing(wanted, daqco.settings) if daqco.running else "",
    )

    def keep_channel(settings: DaqcoSettings) -> None:
        problem = _missing(wanted, settings)
        if ends and problem:
            raise NotAvailable(f"{problem}. Stop steering first")
        if problem and not _missing(wanted, daqco.settings):
            logger.warning("%s; steering is refused until then", problem)

    daqco.before_change(keep_channel)
    return force


def _missing(wanted: str, settings: DaqcoSettings) -> str:
    """Return why the channel `wanted` gives no force; empty where it does, or none is wanted."""
    if not wanted:
        return ""
    active = {each.name: each for each in settings.channel if each.active}
    if wanted not in active:
        return (
            f"force feedback needs the channel {wanted}, and there is no active one of that name; "
            f"there are {', '.join(active)}"
        )
    unit = settings.scales()[active[wanted].scale].unit
    if unit not in MICRONEWTONS:
        units = ", ".join(MICRONEWTONS)
        return f"force feedback needs the channel {wanted} in one of {units}; it is in {unit}"
    return ""
