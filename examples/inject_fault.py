"""See what CoSMic does when a cable comes out while an axis moves."""

from threading import Event

import cosmic


def main() -> None:
    """Move slowly, unplug device 0, plug it in again, and look for the devices once more."""
    with cosmic.connect(world="plain") as rig:
        axis = rig.mico["left.x"]
        axis.set_closed_loop_frequency(500)
        movement = axis.move_to(3000.0, wait=False)
        Event().wait(0.2)
        rig.faults.inject("unplugged", device=0)
        try:
            movement.wait()
        except cosmic.DeviceError as error:
            print(f"the move ended: {error}")
        print(f"left.x is {axis.state}; right.x is {rig.mico['right.x'].state}")
        print(f"missing: {'; '.join(rig.mico.missing)}")
        print(f"all motion is stopped: {rig.mico.check({'right.x': 10.0})}")

        rig.faults.clear("unplugged")
        rig.mico.rescan()
        print(f"after the rescan left.x is {axis.state}")


if __name__ == "__main__":
    main()
