"""Jog an axis: it moves as long as somebody renews, and stops by itself when nobody does."""

from threading import Event

import cosmic


def main() -> None:
    """Hold a key down for half a second, then let go in two ways."""
    pause = Event()  # nobody sets it: waiting on it is a pause
    with cosmic.connect(world="plain") as rig:
        axis = rig.mico["left.x"]

        with axis.jog(direction=1, speed=400.0) as jogging:
            for _ in range(10):
                pause.wait(0.05)
                jogging.renew()
            print(f"held for half a second at 400 um/s: {axis.position_um} um")
        print(f"let go at the end of the block: stands at {standing(axis, jogging)} um")

        jogging = axis.jog(direction=-1, speed=400.0)
        where = standing(axis, jogging)
        print(f"never renewed: the dead man stopped it at {where} um")


def standing(axis, jogging) -> float:
    """Wait until the axis stands and return where."""
    jogging.movement.exception(timeout=5.0)
    return axis.position_um


if __name__ == "__main__":
    main()
