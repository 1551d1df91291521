"""Scan the probe into a fibre with force and image as a bluesky plan, save it, read it back."""

import json
import logging
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd
from bluesky import RunEngine
from bluesky.callbacks.json_writer import JSONLinesWriter
from bluesky.plans import list_scan, scan
from bluesky.simulators import check_limits
from bluesky.utils import FailedStatus, MsgGenerator

import cosmic

FIRST_UM, LAST_UM, POINTS = -4960.0, -5040.0, 9


def approach(rig: cosmic.Rig) -> None:
    """Bring the held fibre in front of the probe, and the probe near it."""
    rig.mico.move({"left.z": -800.0, "left.x": 3600.0})
    rig.mico["probe.y"].move_to(-4900.0)


def push(rig: cosmic.Rig) -> MsgGenerator:
    """Return the plan: the probe goes step by step, at each force and image are taken."""
    detectors = [rig.daqco["force"], rig.vico.camera()]
    return scan(detectors, rig.mico["probe.y"], FIRST_UM, LAST_UM, POINTS)


def into_the_probe(rig: cosmic.Rig) -> MsgGenerator:
    """Return a plan that would drive the jaws into the probe at its second point."""
    return list_scan([rig.daqco["force"]], rig.mico["left.x"], [3600.0, 4500.0])


def rehearse(name: str, plan: MsgGenerator) -> None:
    """Ask the gate about every target of a plan; nothing moves."""
    try:
        check_limits(plan)
        print(f"{name}: allowed")
    except cosmic.MoveRefused as refused:
        print(f"{name}: {refused.verdict.reason}, {' and '.join(refused.verdict.bodies)}")


def run(rig: cosmic.Rig, engine: RunEngine, folder: Path) -> Path:
    """Run the plan; every document of it goes into a file, a line each."""
    rig.daqco["force"].average_s = 0.2
    rig.vico.camera().plan_images(folder)
    engine(push(rig), JSONLinesWriter(str(folder), "push.jsonl"))
    return folder / "push.jsonl"


def read_back(path: Path) -> pd.DataFrame:
    """Return a table, one row a point, from the file alone."""
    documents = [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]
    return pd.DataFrame([each["doc"]["data"] for each in documents if each["name"] == "event"])


def show(table: pd.DataFrame) -> None:
    """Print the table, the stiffness where the probe touches, and how many images are there."""
    columns = {"probe_y": "y_um", "force": "force_un", "force_std": "std_un"}
    print(table[list(columns)].rename(columns=columns).round(1).to_string(index=False))
    touching = table[table["force"] > 10.0]
    slope, _ = np.polyfit(touching["probe_y"], touching["force"], 1)
    print(f"stiffness: {-slope:.2f} uN/um from {len(touching)} points")
    images = [path for path in table.filter(like="_file").to_numpy().ravel() if Path(path).exists()]
    print(f"images: {len(images)}")


def be_refused(rig: cosmic.Rig, engine: RunEngine) -> None:
    """Run the plan that the gate refuses: it ends as a failure, and nothing has touched."""
    try:
        engine(into_the_probe(rig))
    except FailedStatus as failed:
        print(f"the plan failed: {failed.__cause__}")


def main() -> None:
    """Rehearse, scan, read back, and be refused."""
    # A plan that fails is told below, in a line; bluesky's log would have its traceback.
    logging.getLogger("bluesky").setLevel(logging.CRITICAL)
    engine = RunEngine({})
    with tempfile.TemporaryDirectory() as folder, cosmic.connect(rate=5, world="plain") as rig:
        approach(rig)
        rehearse("push", push(rig))
        rehearse("into the probe", into_the_probe(rig))
        path = run(rig, engine, Path(folder))
        show(read_back(path))
        be_refused(rig, engine)


if __name__ == "__main__":
    main()
