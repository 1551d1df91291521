"""Drive the simulated SmarAct library from the C header alone, as any other program would.

Nothing here knows CoSMic's own driver: the library object has the C functions `SA_...` of
SCU3DControl as ctypes function pointers. The clock is the caller's, so that no time is lost.
"""

import ctypes

from cosmic.frame.clock import ManualClock
from cosmic.mico.hw.sim_scu3d import load_simulated_library

SYNCHRONOUS = 0
HOLDING = 4


def checked(status: int) -> None:
    """Raise where the library answered something else than 0."""
    if status != 0:
        raise RuntimeError(f"the library answered {status}")


def main() -> None:
    """Find the reference of one channel and move it 1.5 mm."""
    library = load_simulated_library("LLL,RNN", clock=ManualClock(auto_advance=True))
    value = ctypes.c_int()

    checked(library.SA_InitDevices(SYNCHRONOUS))
    checked(library.SA_MoveToReference_S(0, 0, 1000, 1))  # hold 1000 ms, set zero there
    wait_until_it_stands(library)
    checked(library.SA_MovePositionAbsolute_S(0, 0, 15000, 60000))  # 0.1 um; hold for ever
    wait_until_it_stands(library)
    checked(library.SA_GetPosition_S(0, 0, ctypes.byref(value)))
    print(f"channel 0 of device 0 stands at {value.value / 10} um")

    status = library.SA_GetPosition_S(1, 0, ctypes.byref(value))
    print(f"position of a rotary channel: status {status}, wrong sensor type")
    checked(library.SA_ReleaseDevices())


def wait_until_it_stands(library) -> None:
    """Ask for the status until the channel holds."""
    status = ctypes.c_uint()
    while status.value != HOLDING:
        checked(library.SA_GetStatus_S(0, 0, ctypes.byref(status)))


if __name__ == "__main__":
    main()
