"""A first session with the simulated platform: initialise, move, ask the gate, stop.

Needs no window and no hardware.
"""

from threading import Event

import cosmic
from cosmic.frame.operation import Progress
from cosmic.mico.api.mico import Mico


def show_progress(progress: Progress) -> None:
    """Print one line for each step of a long operation."""
    if progress.text:
        print(f"  {progress.fraction:4.0%}  {progress.text}")


def move(mico: Mico) -> None:
    """Move single axes and two together."""
    left_x = mico["left.x"]
    print(f"left.x to 120 um: it is at {left_x.move_to(120.0)} um")
    print(f"left.x by -5 um: it is at {left_x.move_by(-5.0)} um")
    print(f'left.x to "0.2 mm": it is at {left_x.move_to("0.2 mm")} um')
    print(f"two axes together: {mico.move({'left.x': 10.0, 'right.x': -10.0})}")
    print(f"the table to 15 degrees: it is at {mico['table.rotation'].move_to(15.0)} deg")
    opening = mico["left.gripper"].steps(100, amplitude_v=100.0, frequency_hz=1000)
    print(f"100 steps of the left gripper: about {opening} um, it has no sensor")


def ask_the_gate(mico: Mico) -> None:
    """Ask without moving, then see a move refused."""
    print(f"may left.x go to 500 um? {mico.check({'left.x': 500.0})}")
    try:
        mico["left.x"].move_to(9000.0)
    except cosmic.LimitError as refused:
        verdict = refused.verdict
        print(f"refused, {verdict.reason}: {verdict}")
        print(f"  value {verdict.value} {verdict.unit}, limit {verdict.limit} {verdict.unit}")


def stop_and_reset(rig: cosmic.Rig) -> None:
    """Stop in the middle of a move; nothing moves again before the reset."""
    left_x = rig.mico["left.x"]
    left_x.set_closed_loop_frequency(500)  # a tenth of the usual speed
    movement = left_x.move_to(5000.0, wait=False)
    Event().wait(0.2)
    rig.stop("the example wanted it")
    try:
        movement.wait()
    except cosmic.StoppedError as stopped:
        print(f"the move ended: {stopped}")
    try:
        left_x.move_to(0.0)
    except cosmic.StoppedError as refused:
        print(f"refused, {refused.verdict.reason}: {refused}")
    rig.reset_stop()
    print(f"it stands at {left_x.position_um} um; the stop is reset")
    print(f"left.x to 0 um: it is at {left_x.move_to(0.0)} um")


def main() -> None:
    """Start the platform ten times faster than real time and use it."""
    with cosmic.connect(rate=10, world="plain") as rig:
        print(rig)
        print("initialising: up and away, find the references, go to the start pose")
        rig.mico.initialise(show_progress)
        move(rig.mico)
        ask_the_gate(rig.mico)
        stop_and_reset(rig)
    print("closed: everything stopped, the hold released")


if __name__ == "__main__":
    main()
