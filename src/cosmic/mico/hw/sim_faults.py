"""Faults of the simulated controller, injected by name."""

from abc import abstractmethod
from contextlib import AbstractContextManager
from dataclasses import dataclass
from threading import Lock
from typing import Final, Protocol

from cosmic.frame.arguments import check_fault
from cosmic.frame.clock import Clock
from cosmic.frame.errors import ArgumentError

NAMES: Final = (
    "unplugged",
    "lost_completed",
    "doubled_completed",
    "end_stop",
    "overheated",
    "hv_range",
    "overridden",
    "sensor_lost",
    "slow_answer",
    "blocked_call",
    "lagging",
)
_WITH_DELAY: Final = ("slow_answer", "blocked_call")


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault that is in force.

    Attributes
    ----------
    name : str
        One of `NAMES`.
    device, channel : int or None
        Where, counted along the wiring; None is everywhere.
    delay_s : float
        Of `slow_answer` and `blocked_call`, on the scene's clock.
    """

    name: str
    device: int | None
    channel: int | None
    delay_s: float

    def hits(self, device: int, channel: int | None) -> bool:
        """Whether the fault is in force at that channel; None asks for the device alone."""
        return self.device in (None, device) and (
            self.channel is None or channel is None or self.channel == channel
        )


class FaultyDevice(Protocol):
    """What faults strike; called with its lock held."""

    number: int

    @abstractmethod
    def on_inject(self, fault: Fault, now_s: float) -> None:
        """Let a new fault act on what goes on."""

    @abstractmethod
    def on_clear(self, fault: Fault, now_s: float) -> None:
        """Undo what a fault left behind."""


class Faults:
    """Faults in force; any thread.

    Notes
    -----
    - `unplugged`: the cable is out; calls answer 7, synchronous questions 15, receiving 10.
    - `lost_completed`, `doubled_completed`: COMPLETED is not sent, or sent twice.
    - `end_stop`: an obstacle in the middle of the next movement (or right in front of the running
      one) stops closed-loop movements with 132 until cleared.
    - `overheated`: movements end and are refused with 135 until cleared.
    - `hv_range`: movements end and are refused with 134 until a hardware reset, cleared or not.
    - `overridden`: the hand control unit takes over; the running movement, or each next one
      half-way, ends with 133 instead of COMPLETED.
    - `sensor_lost`: no sensor (130); its position is unknown afterwards.
    - `slow_answer`: packets come, and synchronous calls return, `delay_s` later.
    - `blocked_call`: the next movement call blocks `delay_s`; once; never a stop.
    - `lagging`: where a speed is commanded (MCS2), the stage goes half as fast.

    Parameters
    ----------
    clock : Clock
        The scene's.
    """

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._devices: list[tuple[FaultyDevice, AbstractContextManager[object]]] = []
        self._lock = Lock()
        self._active: tuple[Fault, ...] = ()

    def wire(self, device: FaultyDevice, lock: AbstractContextManager[object]) -> None:
        """Have a device told of its faults from now on, with its lock held."""
        self._devices.append((device, lock))

    @property
    def active(self) -> tuple[Fault, ...]:
        """The faults in force."""
        return self._active

    def inject(
        self,
        name: str,
        *,
        device: int | None = None,
        channel: int | None = None,
        delay_s: float | None = None,
    ) -> None:
        """Put the fault `name` in force at one channel, one device (`channel` None) or all.

        Raises
        ------
        ArgumentError
            No such fault, or a delay where none belongs.
        """
        check_fault(name, NAMES)
        if delay_s is not None and name not in _WITH_DELAY:
            raise ArgumentError(f"fault {name!r} has no delay; those with one: {_WITH_DELAY}")
        if delay_s is not None and not 0.0 <= delay_s < 1e6:
            raise ArgumentError(f"fault {name!r}: a delay is a finite time in s, got {delay_s!r}")
        fault = Fault(name, device, channel, 0.5 if delay_s is None else delay_s)
        with self._lock:
            self._active = (*self._active, fault)
        for struck, lock in self._hit(fault):
            with lock:
                struck.on_inject(fault, self._clock.now_s())

    def clear(
        self, name: str | None = None, *, device: int | None = None, channel: int | None = None
    ) -> None:
        """End the fault `name`, or all of them; with a device or channel only those there.

        Raises
        ------
        ArgumentError
            No such fault.
        """
        if name is not None:
            check_fault(name, NAMES)
        with self._lock:
            ended = tuple(
                fault
                for fault in self._active
                if name in (None, fault.name)
                and device in (None, fault.device)
                and channel in (None, fault.channel)
            )
            self._active = tuple(fault for fault in self._active if fault not in ended)
        for fault in ended:
            for struck, lock in self._hit(fault):
                with lock:
                    struck.on_clear(fault, self._clock.now_s())

    def _hit(self, fault: Fault) -> list[tuple[FaultyDevice, AbstractContextManager[object]]]:
        return [each for each in self._devices if fault.hits(each[0].number, None)]

    def find(self, name: str, device: int, channel: int | None = None) -> Fault | None:
        """Return the fault `name` if it is in force there."""
        for fault in self._active:
            if fault.name == name and fault.hits(device, channel):
                return fault
        return None

    def take(self, name: str, device: int, channel: int) -> Fault | None:
        """Return the fault `name` if it is in force there, and end it: it happens once."""
        if not self._active:
            return None
        with self._lock:
            fault = self.find(name, device, channel)
            if fault is not None:
                at = self._active.index(fault)
                self._active = self._active[:at] + self._active[at + 1 :]
        return fault

    def delay_s(self, device: int, channel: int | None) -> float:
        """Return by how much answers are late there, s."""
        fault = self.find("slow_answer", device, channel) if self._active else None
        return fault.delay_s if fault is not None else 0.0
