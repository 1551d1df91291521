"""From the library handing a COMPLETED packet out to what the GUI thread is told of it.

After COMPLETED the device is asked twice whether it stands and then where, so three answers of
the simulated controller (1 to 2 ms each) are part of the time. `position_changed` is the first
one after the packet that tells the position where the movement ended. It is not sent where that
position had been read before; such movements count for `movement_ended` alone.
"""

import random
import threading
import time
from dataclasses import dataclass, field
from typing import Any

from PySide6.QtCore import QObject

from benchmarks.figures import Figure, main, percentile
from benchmarks.stand import Stand, Traffic, stand, wait_until
from cosmic.mico.core.motion.messages import MovementEnded, PositionChanged
from cosmic.mico.hw import scu3d_ctypes as sa

NAME = "completion"
RECEIVE = "SA_ReceiveNextPacket_A"


@dataclass
class Watched:
    """What is known of one movement; times are those of `perf_counter`."""

    completed_s: float | None = None
    positions: list[tuple[float, float]] = field(default_factory=list)
    ended_s: float | None = None
    where: float | None = None


class Receiver(QObject):
    """Lives in the GUI thread and notes when it is told something."""

    def __init__(self) -> None:
        super().__init__()
        self.watched: dict[str, Watched] = {}
        self.ended = threading.Event()
        self.name = ""

    def on_position(self, changed: PositionChanged) -> None:
        """Note a position."""
        watched = self.watched.get(changed.name)
        if watched is not None:
            watched.positions.append((time.perf_counter(), changed.position))

    def on_ended(self, ended: MovementEnded) -> None:
        """Note the end of a movement."""
        watched = self.watched.get(ended.name)
        if watched is not None and ended.error is None:
            watched.ended_s, watched.where = time.perf_counter(), ended.position
            self.ended.set()


def collect(bench: Stand, receiver: Receiver, count: int) -> list[Watched]:
    """Follow `count` short movements while all other axes keep moving."""
    rng = random.Random(1)
    for commander in {axis.commander for axis in bench.mico}:
        commander.position_changed.connect(receiver.on_position)
        commander.movement_ended.connect(receiver.on_ended)
    axes = [axis for axis in bench.mico if axis.unit == "um" and axis.limits is not None]
    places = {axis.key: bench.manager.address(axis.key) for axis in axes}
    names = {(place.device, place.channel): name for name, place in places.items()}

    def on_packet(when_s: float, args: tuple[Any, ...]) -> None:
        packet = args[2]._obj
        if packet.packetType != sa.SA_COMPLETED_PACKET_TYPE:
            return
        watched = receiver.watched.get(names.get((args[0], packet.channelIndex), ""))
        if watched is not None and watched.completed_s is None:
            watched.completed_s = when_s

    bench.library.left[RECEIVE] = on_packet
    traffic = Traffic(bench.mico)
    traffic.start()
    done: list[Watched] = []
    for number in range(count):
        axis = axes[number % len(axes)]
        traffic.hand_over(axis)
        axis.halt()
        wait_until(lambda axis=axis: not axis.details.in_motion)  # type: ignore[misc]
        time.sleep(0.01)  # a COMPLETED of the halt that is late
        watched = Watched()
        receiver.ended.clear()
        receiver.watched = {axis.key: watched}
        way = rng.uniform(100.0, 500.0)
        position = axis.position_um or 0.0
        movement = axis.move_by(-way if position > 0.0 else way, wait=False)
        if not receiver.ended.wait(5.0):
            raise RuntimeError(f"{axis.key}: nobody was told of the end of {movement!r}")
        receiver.watched = {}
        done.append(watched)
        axis.halt()
        position = axis.position_um or 0.0
        limits = axis.limits or (0.0, 0.0)
        traffic.adopt(axis, axis.set(0.9 * limits[0 if position > 0.0 else 1]))
    traffic.end()
    return done


def follow(count: int, *, repaint: bool) -> list[Watched]:
    """Follow `count` movements on a stand of their own."""
    with stand(repaint=repaint) as bench:
        receiver = Receiver()
        return bench.beside(lambda: collect(bench, receiver, count))


def times_s(done: list[Watched]) -> tuple[list[float], list[float]]:
    """Return how long after COMPLETED the position and the end were told, in s."""
    moved: list[float] = []
    ended: list[float] = []
    for watched in done:
        if watched.completed_s is None or watched.ended_s is None:
            continue
        ended.append(watched.ended_s - watched.completed_s)
        last = [
            when_s - watched.completed_s
            for when_s, where in watched.positions
            if when_s > watched.completed_s and where == watched.where
        ]
        moved += last[:1]
    return moved, ended


def measure(quick: bool = False) -> list[Figure]:
    """Return the figures of one run."""
    found: list[Figure] = []
    for repaint, window in ((True, "panel painted at 30 Hz"), (False, "only changes painted")):
        moved, ended = times_s(follow(2 if quick else 200, repaint=repaint))
        limit = 20 if repaint else None
        found += [
            Figure(NAME, f"{window}: movements", len(ended), ""),
            Figure(NAME, f"{window}: position_changed, p50", 1e3 * percentile(moved, 50), "ms"),
            Figure(
                NAME, f"{window}: position_changed, p99", 1e3 * percentile(moved, 99), "ms", limit
            ),
            Figure(NAME, f"{window}: movement_ended, p99", 1e3 * percentile(ended, 99), "ms"),
        ]
    return found


if __name__ == "__main__":
    main(__doc__, measure)
