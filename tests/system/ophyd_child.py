"""ophyd and bluesky in a process of their own, before and after the platform was stopped.

It prints what it found as a line of JSON, waits for a line, and prints what it finds then.
"""

import json
import sys

from bluesky import RunEngine
from bluesky.plans import scan
from ophyd import EpicsMotor, EpicsSignal, EpicsSignalRO
from ophyd.areadetector.plugins import ImagePlugin
from ophyd.signal import EpicsSignalBase
from ophyd.utils import LimitError, UnknownStatusFailure, WaitTimeoutError

PATIENCE_S = 60.0
"""What is late beside other programs is no failure: only what never comes is."""


def moved(target: float, of: EpicsMotor) -> object:
    try:
        of.set(target).wait(PATIENCE_S)
    except (UnknownStatusFailure, WaitTimeoutError) as exc:
        return type(exc).__name__
    return float(of.user_readback.get(use_monitor=False))


def tell(found: dict[str, object]) -> None:
    sys.stdout.write(json.dumps(found) + "\n")
    sys.stdout.flush()


def seen() -> dict[str, object]:
    """Return what areaDetector's own classes say of an image."""
    image = ImagePlugin("COSMIC:microscope:image:", name="image")
    image.wait_for_connection(timeout=PATIENCE_S)
    array = image.image
    return {
        "shape": list(array.shape),
        "mean": float(array.mean()),
        "kind": image.data_type.get(),
        "colours": image.color_mode.get(as_string=True),
        "of": image.nd_array_port.get(),
    }


def _main() -> None:
    EpicsSignalBase.set_defaults(connection_timeout=PATIENCE_S, timeout=PATIENCE_S)
    motor = EpicsMotor("COSMIC:left_x", name="motor")
    turn = EpicsMotor("COSMIC:table_rotation", name="turn")
    control = EpicsSignal("COSMIC:control", name="control")
    force = EpicsSignalRO("COSMIC:force", name="force")
    for each in (motor, turn, control, force):
        each.wait_for_connection(timeout=PATIENCE_S)
    found: dict[str, object] = {"without control": moved(5.0, motor)}
    control.put(1, wait=True)
    found["with control"] = moved(10.0, motor)
    found["again"] = [moved(10.0, motor) for _ in range(5)]
    documents: list[tuple[str, dict]] = []
    RunEngine()(scan([force], motor, 0, 20, 5), lambda *both: documents.append(both))
    events = [doc["data"] for name, doc in documents if name == "event"]
    found["scan"] = [each["motor"] for each in events]
    found["asked"] = [each["motor_user_setpoint"] for each in events]
    found["force"] = [each["force"] for each in events]
    found["turned"] = moved(3.0, turn)
    found["units"] = [motor.motor_egu.get(as_string=True), turn.motor_egu.get(as_string=True)]
    found["limits"] = list(motor.limits)
    try:
        motor.set(1e6)
    except LimitError as exc:
        found["beyond"] = type(exc).__name__
    found["image"] = seen()
    tell(found)
    sys.stdin.readline()
    stopped = {
        "while stopped": moved(15.0, motor),
        "alarm": int(motor.user_readback.alarm_status),
    }
    tell(stopped)


if __name__ == "__main__":
    _main()
