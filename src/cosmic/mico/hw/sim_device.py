"""What simulated controllers of all makes are alike in: what hangs on them, and its faults."""

import logging
import math
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable, Sequence
from random import Random
from threading import Condition, Lock
from typing import Generic, TypeVar

from cosmic.mico.hw.sim_faults import Fault, Faults
from cosmic.mico.hw.sim_queue import PacketQueue
from cosmic.twin.scene import AtPowerUp, Scene
from cosmic.twin.settings import ControllerSettings, StageKind
from cosmic.twin.stage import Route, Stage

logger = logging.getLogger(__name__)


class LibraryLock:
    """The lock of a simulated library, which a stop never waits for; any thread.

    What has to be done with the lock, and is left here while somebody else has it, is done before
    anybody gets it next: at the latest by whoever has it now, in letting go.
    """

    def __init__(self) -> None:
        self._lock = Lock()
        self._left: deque[Callable[[], object]] = deque()

    def leave(self, work: Callable[[], object]) -> None:
        """Have `work` done with the lock held, here and now if nobody has it."""
        self._left.append(work)
        self._work_off()

    def acquire(self, blocking: bool = True, timeout: float = -1) -> bool:
        """Take it, as any lock."""
        got = self._lock.acquire(blocking, timeout)
        if got:
            self._do_what_is_left()
        return got

    def release(self) -> None:
        """Let go of it."""
        self._lock.release()
        self._work_off()

    def __enter__(self) -> bool:
        return self.acquire()

    def __exit__(self, *_error: object) -> None:
        self.release()

    def _work_off(self) -> None:
        # Again after letting go: what was left in between found the lock taken.
        while self._left and self._lock.acquire(blocking=False):
            try:
                self._do_what_is_left()
            finally:
                self._lock.release()

    def _do_what_is_left(self) -> None:
        while self._left:
            work = self._left.popleft()
            try:
                work()
            except Exception:  # it is of another call than the one that is under way here
                logger.exception("what was left with the simulated library's lock failed")


class SimulatedChannel(ABC):
    """One channel over its stage; everything is called with its library's lock held.

    Parameters
    ----------
    device, index : int
        Its address along the wiring.
    stage : Stage
        What hangs on it.
    """

    def __init__(
        self,
        device: int,
        index: int,
        stage: Stage,
        *,
        settings: ControllerSettings,
        faults: Faults,
        random: Random,
    ) -> None:
        self.device = device
        self.index = index
        self.stage = stage
        self.settings = settings
        self.faults = faults
        self.random = random

    @property
    @abstractmethod
    def next_turn_s(self) -> float:
        """When something changes by itself; inf when nothing does."""

    @abstractmethod
    def advance(self, now_s: float) -> None:
        """Let everything happen that is due by `now_s`."""

    @abstractmethod
    def regain_sensor(self, now_s: float) -> None:
        """Count on from where it was lost, wherever the stage stands by now."""

    def fault(self, name: str) -> bool:
        """Whether a fault is in force here."""
        return self.faults.find(name, self.device, self.index) is not None

    def obstruct_if_faulty(self, position: float, target: float) -> None:
        """Put the obstacle of the fault `end_stop` half-way, unless it stands already."""
        if not self.fault("end_stop") or self.stage.obstructed or target == position:
            return
        low, high = self.stage.kind.low, self.stage.kind.high
        target = min(max(target, low), high)
        self.stage.obstruct((position + target) / 2.0, 1 if target > position else -1)

    def find_coded_marks(self, route: Route, speed: float, *, forward: bool) -> float | None:
        """Have a route pass two coded marks; return where the reference is taken to be."""
        kind = self.stage.kind
        travel = kind.coded_mark_way if forward else -kind.coded_mark_way
        if not route.go(route.position + travel, speed) and not route.go(
            route.position - travel, speed
        ):
            return None
        error = self.random.uniform(-0.5, 0.5) * kind.reference_repeatability
        return kind.reference_mark + error


C = TypeVar("C", bound=SimulatedChannel)


class SimulatedDevice(ABC, Generic[C]):
    """One controller along the wiring of a scene; called with the library's lock held.

    Attributes
    ----------
    number : int
        Its place along the wiring.
    changed : Condition
        Notified when something happened that somebody may wait for.
    """

    number: int
    faults: Faults
    changed: Condition
    channels: Sequence[C]
    queue: PacketQueue

    @property
    def unplugged(self) -> bool:
        """Whether the cable is out."""
        return self.faults.find("unplugged", self.number) is not None

    def advance(self, now_s: float) -> None:
        """Let everything happen that is due by `now_s`."""
        for channel in self.channels:
            channel.advance(now_s)

    def next_event_s(self, now_s: float) -> float:
        """Return when something will happen by itself next; inf when nothing will."""
        turn_s = min((channel.next_turn_s for channel in self.channels), default=math.inf)
        return min(turn_s, self.queue.next_s(now_s))

    def on_inject(self, fault: Fault, now_s: float) -> None:
        """Let a new fault act on what goes on."""
        self.advance(now_s)
        for channel in self.channels:
            if fault.hits(self.number, channel.index):
                self._strike(channel, fault, now_s)
        self.changed.notify_all()

    def on_clear(self, fault: Fault, now_s: float) -> None:
        """Undo what a fault left behind."""
        self.advance(now_s)
        for channel in self.channels:
            if not fault.hits(self.number, channel.index):
                continue
            if fault.name == "sensor_lost":
                channel.regain_sensor(now_s)
            elif fault.name == "end_stop":
                channel.stage.clear_obstruction()
        self.changed.notify_all()

    @abstractmethod
    def _strike(self, channel: C, fault: Fault, now_s: float) -> None:
        """Let a new fault act on a channel."""

    def _stage_at(self, scene: Scene, index: int, name: str | None) -> tuple[Stage, AtPowerUp]:
        """Return what hangs on a connector, and what its channel knows of it at power-up."""
        if name is None:
            stage = Stage(f"nothing at {self.number}.{index}", NOTHING, start=0.0, seed=0)
            return stage, AtPowerUp(known=False, calibrated=False, scale=0.0)
        return scene.stages[name], scene.at_power_up[name]


# A connector with nothing in it: commands are taken and nothing moves.
NOTHING = StageKind(
    unit="um",
    sensor=False,
    positioner_type=0,
    low=0.0,
    high=0.0,
    power_up_low=0.0,
    power_up_high=0.0,
    reference_mark=0.0,
    coded_mark_way=1.0,
    step_at_100v=1.0,
    threshold_v=10.0,
    backward_factor=1.0,
    step_noise=0.0,
    slow_zone=0.0,
    slow_factor=1.0,
    target_threshold=1.0,
    reference_repeatability=0.0,
    calibration_span=1.0,
    drift_per_min_low=0.0,
    drift_per_min_high=0.0,
)
