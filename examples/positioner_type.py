"""A new type of positioner: a rotary table without end stops.

Told to drive to its end stop, it would turn for ever and wind up its cables; so this type does
not know that movement, and the gate refuses it. See docs/how-to/add-a-positioner-type.md.
"""

from typing import ClassVar

import cosmic
from cosmic.mico.core.motion.orders import Calibrate, Motion, MoveBy, MoveTo, Step
from cosmic.mico.core.motion.positioner import TYPE_CLASSES, RotaryPositioner


class EndlessRotaryPositioner(RotaryPositioner):
    """A rotary positioner that can turn on and on: it has no end stop and no reference."""

    motions: ClassVar[tuple[type[Motion], ...]] = (Step, MoveTo, MoveBy, Calibrate)
    advice = "it has no end stop; give degrees"


TYPE_CODE = 4  # what the controller calls the table of the simulated platform


def main() -> None:
    """Register the class and see what the gate says."""
    TYPE_CLASSES[TYPE_CODE] = EndlessRotaryPositioner
    try:
        with cosmic.connect(rate=10, world="plain") as rig:
            table = rig.mico["table.rotation"]
            print(f"to 30 degrees: {table.move_to(30.0)}")
            table.move_to_end_stop("forward")
    except cosmic.MoveRefused as refused:
        print(f"{refused.verdict.reason}: {refused}")
    finally:
        del TYPE_CLASSES[TYPE_CODE]


if __name__ == "__main__":
    main()
