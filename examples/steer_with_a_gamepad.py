"""Steer the left assembly with a gamepad; without one, a recording of a hand stands in for it."""

import sys
import time
from pathlib import Path

import cosmic
from cosmic.frame.errors import CosmicError

RECORDING = Path(__file__).with_name("gamepad.csv")

with cosmic.connect(applications=("mico",), world="plain") as rig:
    steering = rig.mico.teleoperation
    pads = [info for info in steering.devices() if info.kind in ("gamepad", "joystick")]
    device = pads[0].key if "--pad" in sys.argv and pads else f"recorded:{RECORDING}"
    try:
        steering.start(device, "left assembly")
    except CosmicError as exc:
        sys.exit(str(exc))
    said, fastest, began = "", 0.0, rig.mico["left.x"].position_um
    while steering.state.phase not in ("stopped", "off"):
        state = steering.state
        if state.words != said:
            said = state.words
            print(f"{said:30} left.x {rig.mico['left.x'].position_um:8.1f} um")
        fastest = max(fastest, abs(state.velocities.get("left.x", 0.0)))
        time.sleep(0.01)
    print(steering.state.words)
    print(f"left.x went up to {fastest:.0f} um/s")
    print(f"left.x moved {rig.mico['left.x'].position_um - began:.0f} um")
    print(f"left.z is at {rig.mico['left.z'].position_um:.0f} um")
    steering.stop()
