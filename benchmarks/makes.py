"""Completion, start of two axes and stop: the simulated MCS2 beside the simulated SCU."""

import math
import statistics
import time
from collections.abc import Callable

from benchmarks.figures import Figure, main
from cosmic.frame.clock import RatedClock
from cosmic.mico.hw.interface import Channel, Completed, Controller, MatchedMove
from cosmic.mico.hw.scu3d import Scu3dController
from cosmic.mico.hw.sim_scu3d import load_simulated_library as load_scu3d
from cosmic.mico.hw.sim_smaractctl import load_simulated_library as load_smaractctl
from cosmic.mico.hw.smaractctl import SmaractCtlController
from cosmic.twin.stage import Stage

NAME = "makes"
FIRST, SECOND = Channel(0, 0), Channel(0, 1)


def median_ms(count: int, call: Callable[[int], float]) -> float:
    """Return the median of what `call` takes in seconds, in ms."""
    return 1e3 * statistics.median(call(number) for number in range(count))


def completion_s(controller: Controller, stage: Stage, clock: RatedClock, target: float) -> float:
    """Return the time from the end of a stage's path to the event that tells it."""
    controller.move_to(FIRST, target, "um", hold_s=math.inf)
    end_s = stage.path.end_s
    while not isinstance(controller.receive(0, 0.2), Completed):
        pass
    return clock.now_s() - end_s


def spent_s(call: Callable[[], None]) -> float:
    """Return how long a call takes."""
    before_s = time.perf_counter()
    call()
    return time.perf_counter() - before_s


def start_two(controller: Controller, distance_um: float) -> None:
    """Send two axes off: as one command group where there is one, else back to back."""
    if controller.capabilities.group_start:
        moves = [
            MatchedMove(at, distance_um, "um", math.inf, 1000.0, 50_000.0, 100.0)
            for at in (FIRST, SECOND)
        ]
        controller.move_together(moves)
        return
    for at in (FIRST, SECOND):
        controller.move_to(at, distance_um, "um", hold_s=math.inf)


def start_all(controller: Controller, channels: int, distance_um: float) -> None:
    """Send all axes of a device off: as one command group where there is one."""
    if controller.capabilities.group_start:
        moves = [
            MatchedMove(Channel(0, number), distance_um, "um", math.inf, 1000.0, 50_000.0, 100.0)
            for number in range(channels)
        ]
        controller.move_together(moves)
        return
    for number in range(channels):
        controller.move_to(Channel(0, number), distance_um, "um", hold_s=math.inf)


def stop_all(controller: Controller, channels: int) -> None:
    """Stop all axes of a device."""
    for number in range(channels):
        controller.stop(Channel(0, number))


def figures_of_full(make: str, channels: int, count: int) -> list[Figure]:
    """Return the figures of one device with all its channels."""
    clock = RatedClock(1.0)
    load = load_scu3d if make == "SCU" else load_smaractctl
    kind = Scu3dController if make == "SCU" else SmaractCtlController
    controller: Controller = kind(load("L" * channels, clock=clock), simulated=True)
    controller.open()

    def start(number: int) -> float:
        spent = spent_s(lambda: start_all(controller, channels, 200.0 * (number % 2)))
        stop_all(controller, channels)
        return spent

    def stop(number: int) -> float:
        start_all(controller, channels, 500.0 * (number % 2))
        return spent_s(lambda: stop_all(controller, channels))

    measured = {f"start of all {channels} axes": start, f"stop of all {channels} axes": stop}
    figures = [
        Figure(NAME, f"{make}: {name}", median_ms(count, call), "ms")
        for name, call in measured.items()
    ]
    controller.close()
    return figures


def figures_of(make: str, count: int) -> list[Figure]:
    """Return the figures of one make."""
    clock = RatedClock(1.0)
    library = load_scu3d(clock=clock) if make == "SCU" else load_smaractctl(clock=clock)
    kind = Scu3dController if make == "SCU" else SmaractCtlController
    controller: Controller = kind(library, simulated=True)
    controller.open()
    controller.report_completion(FIRST)
    stage = library.scene.stages["0.0"]

    def complete(number: int) -> float:
        return completion_s(controller, stage, clock, 10.0 * (number % 2 + 1))

    def start(number: int) -> float:
        return spent_s(lambda: start_two(controller, 200.0 * (number % 2)))

    def stop(number: int) -> float:
        controller.move_to(FIRST, 500.0 * (number % 2), "um", hold_s=math.inf)
        return spent_s(lambda: controller.stop(FIRST))

    measured = {
        "completion after the end": complete,
        "start of two axes": start,
        "stop of one axis": stop,
    }
    figures = [
        Figure(NAME, f"{make}: {name}", median_ms(count, call), "ms")
        for name, call in measured.items()
    ]
    controller.close()
    return figures


def measure(quick: bool = False) -> list[Figure]:
    """Return the figures of one run."""
    count = 3 if quick else 200
    two = [figure for make in ("SCU", "MCS2") for figure in figures_of(make, count)]
    full = [("SCU", 3), ("MCS2", 3), ("MCS2", 18)]
    few = max(3, count // 4)
    return two + [each for make, most in full for each in figures_of_full(make, most, few)]


if __name__ == "__main__":
    main(__doc__, measure)
