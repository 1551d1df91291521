"""Initialise a platform that was just switched on: step by step, and once more without need."""

import cosmic
from cosmic.frame.operation import Progress


def show(progress: Progress) -> None:
    """Print one line a step."""
    if progress.text and not progress.done:
        print(f"  {progress.fraction:4.0%}  {progress.text}")


def known(rig: cosmic.Rig) -> str:
    """Say how many of the axes with a sensor know where they are."""
    sensed = [axis for axis in rig.mico if axis.limits is not None]
    found = [axis for axis in sensed if axis.confidence == "known"]
    return f"{len(found)} of {len(sensed)} positions are known"


def agree(text: str) -> bool:
    """Answer a step that asks; a script that cannot look had better say no."""
    print(f"asked: {text}")
    return True


def main() -> None:
    """Start the simulated platform as it is at power-up and initialise it."""
    with cosmic.connect(applications=("mico",), rate=20, cold=True, world="plain") as rig:
        print(f"at power-up {known(rig)}")
        try:
            rig.mico["left.x"].move_to(100.0)
        except cosmic.MoveRefused as refused:
            print(f"refused: {refused}")
        rig.mico.initialise(show, confirm=agree)
        print(f"after initialising {known(rig)}")
        print(f"left.x to 100 um: it is at {rig.mico['left.x'].move_to(100.0)} um")
        print("once more, skipping what is known:")
        rig.mico.initialise(show, skip_known=True)
        print(f"left.x is back in its start pose, at {rig.mico['left.x'].position_um} um")
        rig.stop("the example wanted it")
        try:
            rig.mico.initialise()
        except cosmic.StoppedError as stopped:
            print(stopped)


if __name__ == "__main__":
    main()
