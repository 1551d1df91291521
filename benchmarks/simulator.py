"""CPU time of one call of the simulated library, from Python through its C function pointers."""

import time
from ctypes import byref
from typing import Any

from benchmarks.figures import Figure, main
from cosmic.mico.hw import scu3d_ctypes as sa
from cosmic.mico.hw.sim_scu3d import load_simulated_library

NAME = "simulator"
HOLD_MS = 60_000


def cost_us(library: Any, name: str, count: int, *args: object) -> float:
    """Return the CPU time of one call, in us; what it sends is thrown away between the calls."""
    function = getattr(library, name)
    spent_s = 0.0
    for number in range(count):
        channel = number % 3
        before_s = time.thread_time()
        status = function(0, channel, *args)
        spent_s += time.thread_time() - before_s
        if status != sa.SA_OK:
            raise RuntimeError(f"{name} answered {status}")
        if number % 500 == 499:
            time.sleep(0.003)
            receive(library, 500)
    return 1e6 * spent_s / count


def receive(library: Any, count: int) -> float:
    """Take up to `count` packets that wait; return the CPU time of one, in us."""
    packet = sa.SA_PACKET()
    spent_s, taken = 0.0, 0
    for _ in range(count):
        before_s = time.thread_time()
        status = library.SA_ReceiveNextPacket_A(0, 0, byref(packet))
        used_s = time.thread_time() - before_s
        if status != sa.SA_OK:
            raise RuntimeError(f"SA_ReceiveNextPacket_A answered {status}")
        if packet.packetType == sa.SA_NO_PACKET_TYPE:
            break
        spent_s, taken = spent_s + used_s, taken + 1
    return 1e6 * spent_s / max(taken, 1)


def measure(quick: bool = False) -> list[Figure]:
    """Return the figures of one run."""
    count = 30 if quick else 3000
    library: Any = load_simulated_library()
    if library.SA_InitDevices(sa.SA_ASYNCHRONOUS_COMMUNICATION) != sa.SA_OK:
        raise RuntimeError("the simulated library does not open")
    figures = []
    # Slow, so that the channels move all the time and their questions are asked in motion.
    for channel in range(3):
        library.SA_SetClosedLoopMaxFrequency_A(0, channel, 10)
        library.SA_MovePositionAbsolute_A(0, channel, 20_000, HOLD_MS)
    for name, args in (
        ("SA_GetStatus_A", ()),
        ("SA_GetPosition_A", ()),
        ("SA_MovePositionAbsolute_A", (20_000, HOLD_MS)),
        ("SA_Stop_A", ()),
    ):
        spent_us = cost_us(library, name, count, *args)
        figures.append(Figure(NAME, name, spent_us, "us CPU a call"))
        time.sleep(0.003)
        receive(library, 2 * count)
    for number in range(min(count, 1000)):
        library.SA_GetStatus_A(0, number % 3)
    time.sleep(0.003)
    spent_us = receive(library, min(count, 1000))
    figures.append(Figure(NAME, "SA_ReceiveNextPacket_A", spent_us, "us CPU a call"))
    library.SA_ReleaseDevices()
    return figures


if __name__ == "__main__":
    main(__doc__, measure)
