"""Follow a movement of two axes: the positions as they are read, and the end of it.

The signals arrive in the threads of the devices, because the connections are direct: a script
has no event loop that a queued call could arrive in. A function that is connected must therefore
be quick and thread-safe; this one puts what it hears on a queue.
"""

from queue import Empty, SimpleQueue

from PySide6.QtCore import Qt

import cosmic
from cosmic.mico.core.motion.messages import PositionChanged


def main() -> None:
    """Print the positions that are read while two axes move slowly."""
    heard: SimpleQueue[PositionChanged] = SimpleQueue()
    with cosmic.connect(world="plain") as rig:
        for commander in {axis.commander for axis in rig.mico}:  # one for each device
            commander.position_changed.connect(heard.put, Qt.ConnectionType.DirectConnection)
        for name in ("left.x", "right.y"):
            rig.mico[name].set_closed_loop_frequency(500)

        group = rig.mico.move({"left.x": 500.0, "right.y": -500.0}, wait=False)
        while not group.done:
            try:
                changed = heard.get(timeout=0.1)
            except Empty:
                continue
            print(f"{changed.name:8} {changed.position:7.1f} {changed.unit}")
        print(f"reached {group.wait()}")


if __name__ == "__main__":
    main()
