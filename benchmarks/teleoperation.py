"""From a gamepad to the library, with a window that paints and axes that move.

A gamepad that exists in SDL only is deflected at random moments; the time runs from there to the
call that moves the axis, or stops it. Beside it: how often the device is read, an axis is commanded
while the stick moves on, and the force is set, and how soon the axis is stopped when the gamepad is
unplugged.
"""

import random
import threading
import time
from collections.abc import Callable

from benchmarks.figures import Figure, main, percentile
from benchmarks.stand import Stand, stand, wait_until
from cosmic.mico.core.teleoperation.settings import TeleoperationProfileSettings
from cosmic.mico.core.teleoperation.state import TeleoperationPhase
from cosmic.mico.hw.interface import PositionerKind
from cosmic.testing.virtual_gamepad import VirtualGamepad

NAME = "teleoperation"
MOVE, STOP = "SA_MovePositionAbsolute_A", "SA_Stop_A"
PROFILE = {
    "name": "benchmark",
    "axis": [
        {"input": "left_x", "positioner": "left.x"},
        {"input": "left_y", "positioner": "left.y"},
    ],
}
CHUNKS_HZ = 200.0


class Calls:
    """When the library was called for one axis."""

    def __init__(self, bench: Stand, axis: str) -> None:
        self._address = bench.mico[axis].details.address
        self._steering = bench.mico.teleoperation
        self._wanted = threading.Condition()
        self.times_s: dict[str, list[float]] = {MOVE: [], STOP: []}
        for name in self.times_s:
            bench.library.entered[name] = self._watcher(name)

    def _watcher(self, name: str) -> Callable[[float, tuple[int, ...]], None]:
        def entered(when_s: float, args: tuple[int, ...]) -> None:
            if (args[0], args[1]) == (self._address.device, self._address.channel):
                with self._wanted:
                    self.times_s[name].append(when_s)
                    self._wanted.notify_all()

        return entered

    def after(self, name: str, since_s: float) -> float:
        """Return how long after `since_s` the first such call came."""

        def found() -> float | None:
            return next((when for when in self.times_s[name] if when >= since_s), None)

        with self._wanted:
            if not self._wanted.wait_for(lambda: found() is not None, 1.0):
                state = self._steering.state
                raise TimeoutError(f"{name} was not called: {state.words}, {state.refused}")
        return (found() or since_s) - since_s


class Background:
    """Keeps the other assembly moving, and hands a force to the hand, as chunks would."""

    def __init__(self, bench: Stand) -> None:
        self._bench = bench
        self._end = threading.Event()
        self._threads = [
            threading.Thread(target=self._move, daemon=True),
            threading.Thread(target=self._feel, daemon=True),
        ]
        for thread in self._threads:
            thread.start()

    def _move(self) -> None:
        way = 50.0
        while not self._end.wait(0.05):
            self._bench.mico.move_by({f"right.{name}": way for name in "xyz"}, wait=False).wait(5.0)
            way = -way

    def _feel(self) -> None:
        number = 0
        while not self._end.wait(1.0 / CHUNKS_HZ):
            number += 1
            self._bench.mico.teleoperation.feel({"y": 0.1 + 0.05 * (number % 2)})

    def end(self) -> None:
        """Leave everything at rest."""
        self._end.set()
        for thread in self._threads:
            thread.join()


def collect(bench: Stand, count: int) -> dict[str, list[float]]:
    """Return delays in seconds and rates in hertz, by what they are of."""
    rng, found = random.Random(1), dict[str, list[float]]()
    steering = bench.mico.teleoperation
    steering.set_focus(True)
    if bench.mico["left.x"].kind is not PositionerKind.LINEAR:
        raise TypeError("the benchmark steers linear axes")
    with VirtualGamepad() as pad:
        steering.set_profile(TeleoperationProfileSettings.model_validate(PROFILE))
        steering.start(pad.key, "benchmark")
        time.sleep(0.5)  # the window finds out that it is active
        wait_until(lambda: steering.state.phase is TeleoperationPhase.ARMED)
        calls, background = Calls(bench, "left.x"), Background(bench)
        for number in range(count):
            time.sleep(rng.uniform(0.03, 0.06))
            wait_until(lambda: steering.state.phase is TeleoperationPhase.ARMED)
            began_s = time.perf_counter()
            pad.push("left_x", 0.6 if number % 2 else -0.6)
            found.setdefault("move", []).append(calls.after(MOVE, began_s))
            time.sleep(rng.uniform(0.03, 0.06))
            began_s = time.perf_counter()
            pad.push("left_x", 0.0)
            try:
                found.setdefault("stop", []).append(calls.after(STOP, began_s))
            except TimeoutError:  # the dead-man was quicker, for this process got no time
                found.setdefault("dead man", []).append(1.0)
        found |= rates(bench, pad, calls, 0.3 if count < 10 else 3.0)
    for _ in range(max(1, count // 10)):
        found.setdefault("lost", []).append(lose(bench, calls))
    background.end()
    steering.stop()
    return found


def rates(
    bench: Stand, pad: VirtualGamepad, calls: Calls, duration_s: float
) -> dict[str, list[float]]:
    """Return rates while a stick is moved all the time."""
    before, began_s = len(calls.times_s[MOVE]), time.perf_counter()
    number = 0
    while time.perf_counter() < began_s + duration_s:
        number += 1
        pad.push("left_x", 0.5 + 0.4 * (number % 50) / 50.0)
        time.sleep(0.002)
    state = bench.mico.teleoperation.state
    sent = len(calls.times_s[MOVE]) - before
    pad.push("left_x", 0.0)
    wait_until(lambda: not bench.mico["left.x"].details.in_motion)
    return {
        "commanded": [sent / (time.perf_counter() - began_s)],
        "polled": [state.poll_hz],
        "felt": [state.feedback_hz],
    }


def lose(bench: Stand, calls: Calls) -> float:
    """Return how long after a gamepad was unplugged its axis was stopped."""
    steering = bench.mico.teleoperation
    with VirtualGamepad() as pad:
        steering.start(pad.key, "benchmark")
        wait_until(lambda: steering.state.phase is TeleoperationPhase.ARMED)
        before = len(calls.times_s[MOVE])
        pad.push("left_x", 0.6)
        wait_until(lambda: len(calls.times_s[MOVE]) > before + 3)
        began_s = time.perf_counter()
        pad.unplug()
        return calls.after(STOP, began_s)


def measure(quick: bool = False) -> list[Figure]:
    """Return the figures of one run."""
    with stand() as bench:
        bench.window.activateWindow()  # what is steered stands while no window is active
        found = bench.beside(lambda: collect(bench, 4 if quick else 300))
    return [
        Figure(NAME, "gamepad to first move, p50", 1e3 * percentile(found["move"], 50), "ms"),
        Figure(NAME, "gamepad to first move, p99", 1e3 * percentile(found["move"], 99), "ms", 15),
        Figure(NAME, "gamepad to stop, p99", 1e3 * percentile(found["stop"], 99), "ms", 15),
        Figure(NAME, "unplugged to stop, p99", 1e3 * percentile(found["lost"], 99), "ms", 100),
        Figure(NAME, "stopped by the dead-man before", len(found.get("dead man", ())), ""),
        # Rates have a least value for a target, which their periods turn into a largest one.
        Figure(NAME, "device read every", 1e3 / found["polled"][0], "ms", 1e3 / 300),
        Figure(NAME, "axis commanded every", 1e3 / max(found["commanded"][0], 0.1), "ms", 10),
        Figure(NAME, "force set every", 1e3 / max(found["felt"][0], 0.1), "ms"),
    ]


if __name__ == "__main__":
    main(__doc__, measure)
