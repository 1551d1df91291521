"""Simulated SCUs with RS-232 firmware: their ASCII protocol over the twin, byte by byte.

`SimulatedLine` has the shape of `serial.Serial`; `sim_scu_pty` puts one on a pseudo terminal, so
that programs of other people can talk to it.
"""

import math
from threading import Condition
from typing import Final

from cosmic.frame.clock import Clock, RatedClock
from cosmic.frame.errors import DeviceFault, NotConnectedError
from cosmic.mico.hw.sim_device import LibraryLock
from cosmic.mico.hw.sim_faults import Faults
from cosmic.mico.hw.sim_scu3d_device import Device
from cosmic.mico.hw.sim_scu3d_types import Refusal
from cosmic.mico.hw.sim_scu_serial_commands import AnsweredError, Settings, carry_out
from cosmic.twin.scene import Scene
from cosmic.twin.settings import shipped_settings

DEFAULT_LAYOUT: Final = "LLL,LLL,LLN,RNN"
BAUD: Final = 9600
_BITS_PER_BYTE: Final = 10
_COMPLETED, _FAILED = 4, 1
_OTHER: Final = 27
_CODES: Final[dict[int, int]] = {
    129: 2,
    130: 19,
    131: 20,
    132: 21,
    134: 23,
    135: 24,
    136: 25,
    137: 26,
    138: 27,
}
"""Error codes of this protocol by those of the library for USB; for the rest 27, a guess."""


class SimulatedUnit:
    """One unit: takes bytes, moves its stages, and has bytes to say; any thread.

    Parameters
    ----------
    number : int
        Its place along the wiring of the scene.
    """

    def __init__(self, number: int, scene: Scene, faults: Faults, baud: int = BAUD) -> None:
        self.lock = LibraryLock()
        self.clock: Clock = scene.clock
        self._scene = scene
        self._device = Device(number, scene, faults, self.lock, newest_error=255)
        self.changed: Condition = self._device.changed
        with self.changed:
            self._device.open(asynchronous=True, reset=False, now_s=scene.clock.now_s())
        self._settings = Settings(self._device)
        self._byte_s = _BITS_PER_BYTE / baud
        self._heard = b""
        self._heard_s = self.clock.now_s()
        self._said: list[tuple[float, bytes]] = []

    @property
    def serial(self) -> int:
        """What it answers to ``GID``."""
        return self._device.serial

    @property
    def unplugged(self) -> bool:
        """Whether the cable is out."""
        return self._device.unplugged

    @property
    def device(self) -> Device:
        """Its channels."""
        return self._device

    # The line

    def hear(self, data: bytes) -> None:
        """Take bytes that arrive now; a colon begins a command, wherever it comes."""
        with self.changed:
            now_s = self.clock.now_s()
            self._go_on(now_s)
            for byte in data:
                if byte in b":\n":
                    self._obey(now_s)
                    self._heard = b":" if byte == ord(":") else b""
                elif self._heard:
                    self._heard += bytes([byte])
            self.changed.notify_all()
        self._scene.keep_up()

    def say(self) -> bytes:
        """Return the bytes that have left the unit by now."""
        with self.lock:
            now_s = self.clock.now_s()
            self._go_on(now_s)
            due = [text for due_s, text in self._said if due_s <= now_s]
            del self._said[: len(due)]
            return b"".join(due)

    def next_s(self) -> float:
        """Return when there may be something to say; with the lock held. inf for never."""
        now_s = self.clock.now_s()
        first_s = self._said[0][0] if self._said else math.inf
        return min(first_s, self._device.next_event_s(now_s))

    def _utter(self, text: str, now_s: float) -> None:
        begin_s = max([now_s, *(due_s for due_s, _ in self._said)])
        data = f":{text}\n".encode("ascii")
        self._said.append((begin_s + len(data) * self._byte_s, data))

    def _go_on(self, now_s: float) -> None:
        """Let happen what is due, and say what of it is to be reported."""
        over_s = self._heard_s + self._settings.keep_alive_s
        if self._settings.keep_alive_s > 0.0 and over_s < now_s:
            # It stopped then, though nobody looks before now.
            self._heard_s = now_s
            self._device.advance(over_s)
            for channel in self._device.channels:
                channel.stop(over_s)
        self._device.advance(now_s)
        while (packet := self._device.queue.head(now_s)) is not None:
            self._device.queue.pop(now_s)
            kind, index, code = packet[0], packet[1], packet[2]
            if kind == _COMPLETED:
                self._utter(f"C{index}", now_s)
            elif kind == _FAILED and self._reported(index, _CODES.get(code, _OTHER)):
                self._utter(f"CE{index}E{_CODES.get(code, _OTHER)}", now_s)

    def _reported(self, index: int, code: int) -> bool:
        # Only 21 and 22 can be switched off; that the others always come is a guess.
        return code not in (21, 22) or (index, code) in self._settings.reports

    # Commands

    def _obey(self, now_s: float) -> None:
        text = self._heard[1:].decode("ascii", "replace")
        if not text:
            return
        try:
            answers = carry_out(self._settings, text, now_s)
            code = 0
        except AnsweredError as exc:
            answers, code = [], exc.code
        except Refusal as exc:
            answers, code = [], _CODES.get(exc.code, _OTHER)
        if code == 0:
            self._heard_s = now_s
        if not answers and self._settings.automatic:
            answers = [f"E{code}"]
        elif not answers:
            self._settings.last_error = code
        for each in answers:
            self._utter(each, now_s)


class SimulatedLine:
    """One end of a serial line with a simulated unit at the other; the shape of `serial.Serial`.

    Parameters
    ----------
    wait_s : float
        How long `read` waits, on the clock of the scene.
    """

    def __init__(self, unit: SimulatedUnit, wait_s: float = 0.02) -> None:
        self._unit = unit
        self._wait_s = wait_s
        self._arrived = b""
        self._open = True

    @property
    def in_waiting(self) -> int:
        """Bytes that have arrived."""
        self._check_there()
        self._arrived += self._unit.say()
        return len(self._arrived)

    def read(self, size: int = 1) -> bytes:
        """Return up to `size` bytes, waiting for the first one."""
        until_s = self._unit.clock.now_s() + self._wait_s
        while not self.in_waiting and self._unit.clock.now_s() < until_s:
            with self._unit.changed:
                self._unit.clock.wait(self._unit.changed, min(until_s, self._unit.next_s()))
        data, self._arrived = self._arrived[:size], self._arrived[size:]
        return data

    def write(self, data: bytes) -> int:
        """Send."""
        self._check_there()
        self._unit.hear(data)
        return len(data)

    def close(self) -> None:
        """Give the port back."""
        self._open = False

    def _check_there(self) -> None:
        if not self._open or self._unit.unplugged:
            raise OSError("the simulated line is not there")


class SimulatedScus:
    """Units on lines, and the trouble that can be injected into them.

    Parameters
    ----------
    layout, rate, seed, clock, scene
        As of `sim_scu3d.load_simulated_library`.
    baud : int
        How fast the lines are; bytes take their time.
    """

    def __init__(
        self,
        layout: str = DEFAULT_LAYOUT,
        rate: float = 1.0,
        seed: int = 0,
        clock: Clock | None = None,
        scene: Scene | None = None,
        *,
        baud: int = BAUD,
    ) -> None:
        if scene is None:
            time = RatedClock(rate) if clock is None else clock
            scene = Scene.from_layout(layout, shipped_settings(), time, seed)
        self.scene = scene
        self.faults = Faults(scene.clock)
        self.units = [
            SimulatedUnit(number, scene, self.faults, baud) for number in scene.devices_of("scu3d")
        ]
        for unit in self.units:
            self.faults.wire(unit.device, unit.changed)

    def open_port(self, name: str) -> SimulatedLine:
        """Return the line to the unit of this number.

        Raises
        ------
        NotConnectedError
            It is unplugged.
        """
        unit = self.units[int(name)]
        if unit.unplugged:
            raise NotConnectedError(
                f"the simulated line {name} is not there", fault=DeviceFault.COMMUNICATION
            )
        return SimulatedLine(unit)
