"""ophyd-async's Motor in a process of its own, before and after the platform was stopped.

It prints what it found as a line of JSON, waits for a line, and prints what it finds then.
"""

import json
import sys

import bluesky.plan_stubs as bps
from bluesky import RunEngine
from bluesky.plans import scan
from bluesky.run_engine import call_in_bluesky_event_loop
from bluesky.utils import FailedStatus
from ophyd_async.core import init_devices
from ophyd_async.epics.core import epics_signal_r, epics_signal_rw
from ophyd_async.epics.motor import Motor

PATIENCE_S = 60.0
"""What is late beside other programs is no failure: only what never comes is."""


def tell(found: dict[str, object]) -> None:
    sys.stdout.write(json.dumps(found) + "\n")
    sys.stdout.flush()


def _main() -> None:
    engine = RunEngine()
    with init_devices(timeout=PATIENCE_S):
        motor = Motor("COSMIC:left_x")
        turn = Motor("COSMIC:table_rotation")
        force = epics_signal_r(float, "COSMIC:force")
        control = epics_signal_rw(int, "COSMIC:control")

    def moved(*what: object) -> object:
        try:
            engine(bps.mv(*what))
        except FailedStatus as exc:
            return type(exc.__cause__).__name__
        return call_in_bluesky_event_loop(what[0].user_readback.get_value())

    def refused(target: float) -> list[object]:
        """Return where it is, and the alarm: aioca 2.1 hides from ophyd-async that a put failed."""
        moved(motor, target)
        read = call_in_bluesky_event_loop(motor.user_readback.read())["motor"]
        return [read["value"], read["alarm_severity"]]

    found: dict[str, object] = {"without control": refused(-200.0)}
    engine(bps.mv(control, 1))
    found["together"] = [moved(motor, 10.0, turn, 3.0), moved(turn, 3.0)]
    documents: list[tuple[str, dict]] = []
    engine(scan([force], motor, 0, 20, 5), lambda *both: documents.append(both))
    found["scan"] = [each["data"]["motor"] for name, each in documents if name == "event"]
    (keys,) = (each["data_keys"] for name, each in documents if name == "descriptor")
    found["units"] = {name: each["units"] for name, each in keys.items()}
    found["beyond"] = moved(motor, 1e6)
    tell(found)
    sys.stdin.readline()
    tell({"while stopped": refused(-200.0)})


if __name__ == "__main__":
    _main()
