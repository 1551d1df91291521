"""See what CoSMic does when a cable comes out while an axis moves.

`cosmic.connect()` keeps the simulated library to itself. This example puts the same parts
together by hand, so that it can inject faults into the library by name.
"""

from threading import Event

import cosmic
from cosmic.app.platform import load_platform, load_twin
from cosmic.frame.clock import WallClock
from cosmic.frame.failure import FailurePolicy
from cosmic.mico.api.application import MicoApplication
from cosmic.mico.api.mico import Mico
from cosmic.mico.hw.scu3d import Scu3dController
from cosmic.mico.hw.sim_scu3d import load_simulated_library
from cosmic.twin.scene import Scene


def main() -> None:
    """Unplug device 0 in the middle of a movement."""
    file, path = load_platform(None)
    clock = WallClock()
    library = load_simulated_library(scene=Scene.from_settings(load_twin(file, path), clock))
    controller = Scu3dController(library, simulated=True)
    application = MicoApplication(controller, file.mico, clock=clock, policy=FailurePolicy())
    application.initialize()
    try:
        lose_a_cable(Mico(application), library.faults)
    finally:
        application.shut_down()


def lose_a_cable(mico: Mico, faults) -> None:
    """Move slowly, unplug, plug in again, and look for the devices once more."""
    axis = mico["left.x"]
    axis.set_closed_loop_frequency(500)
    movement = axis.move_to(3000.0, wait=False)
    Event().wait(0.2)
    faults.inject("unplugged", device=0)
    try:
        movement.wait()
    except cosmic.DeviceError as error:
        print(f"the move ended: {error}")
    Event().wait(0.2)  # the stop of everything else follows right after
    print(f"left.x is {axis.state}; right.x is {mico['right.x'].state}")
    print(f"missing: {'; '.join(mico.missing)}")
    print(f"all motion is stopped: {mico.check({'right.x': 10.0})}")

    faults.clear("unplugged")
    mico.rescan()
    print(f"after the rescan left.x is {axis.state}")


if __name__ == "__main__":
    main()
