"""Writes fibres into a campaign until it is killed; started by the tests.

For each line read, "FOLDER", a process is forked that goes on with the campaign there. It says its
own number, then "open", then the number of each fibre whose end was written, each in a line.
"""

import os
import sys
from pathlib import Path

import numpy as np

from cosmic.autonomy.campaign.records import FibreImage, FibreRecord, Outcome, Pose, Series
from cosmic.autonomy.campaign.resume import resume
from cosmic.autonomy.campaign.store import CampaignStore


def say(text: str) -> None:
    os.write(1, f"{text}\n".encode())


def write(folder: Path) -> None:
    store = CampaignStore.open(folder)
    serial = resume(store).finished
    say("open")
    pixels = np.zeros((200, 200), np.uint8)
    while True:
        number = store.begin_fibre(Pose(float(serial), 0.0, 0.0), time_s=float(serial))
        store.note("grasp", "move", {"left_z_um": -850.0}, time_s=float(serial), fibre=number)
        values = np.full(500, float(serial))
        store.finish_fibre(
            FibreRecord(
                number,
                Outcome.GOOD,
                float(serial),
                serial + 0.5,
                peak_force_un=float(serial),
                images=(FibreImage("fibre", pixels, 0.0),),
                series=(Series("force", "uN", values, values),),
            )
        )
        say(str(serial))
        serial += 1


for line in sys.stdin:
    child = os.fork()
    if child == 0:
        say(str(os.getpid()))
        write(Path(line.strip()))
    os.waitpid(child, 0)
    say("gone")
