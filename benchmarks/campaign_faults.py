"""One fault at a time in the middle of a campaign: whether it goes on, and whether it is safe.

Each fault is injected once into a campaign of easy fibres, while the first is treated. Recovered:
two were measured, without a hand. Safe: the campaign ended by itself and said why, all axes stand,
no body ran into another that should not, and no force came near the sensor's end; scored from the
twin's truth.

What would last for ever, such as a plug pulled out, is cleared after some seconds, as a loose
contact or an overload is: nothing recovers alone from what only a hand can mend. Some of these are
then left as they are: the campaign has to end within half a minute and name what is broken.

    python -m benchmarks.campaign_faults          # about 25 minutes on two quiet cores
"""

import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from threading import Event
from typing import Any

import cosmic
from benchmarks.figures import Figure, main
from cosmic.autonomy.campaign.records import Outcome
from cosmic.frame.clock import WALL
from cosmic.twin.truth import read_truth

NAME = "campaign_faults"
RATE = 20.0
LIMIT_S = 120.0
REAL_RATE, REAL_LIMIT_S = 1.0, 600.0
"""A camera is waited for by the wall: how soon all is over counts where both clocks are one."""
PEAK_UN = 0.8 * 180.0
RECIPE = """
procedure = "bend test"
[sample]
name = "three-dry"
[stop]
count = 3
good = 2
time_s = 900.0
[output]
pictures = false
html = false
pdf = false
table = false
"""


@dataclass(frozen=True, slots=True)
class Trouble:
    """A fault and when it strikes.

    Attributes
    ----------
    lasts_wall_s : float
        Wall time after which it is cleared; 0: it clears itself, or never.
    lasts_s : float
        The same on the platform's clock, by which the force is waited for.
    words : str
        What the end must name where it is not cleared and cannot be mended; "" where it can.
    """

    name: str
    at: str = "turn the table"
    where: tuple[tuple[str, Any], ...] = ()
    lasts_wall_s: float = 0.0
    lasts_s: float = 0.0
    words: str = ""

    def is_over(self, passed_s: float, passed_wall_s: float) -> bool:
        """Return whether it is cleared so long after it struck."""
        return 0.0 < self.lasts_s <= passed_s or 0.0 < self.lasts_wall_s <= passed_wall_s


TROUBLES = (
    Trouble("missed_grasp"),
    Trouble("slip_in_lift"),
    Trouble("drop"),
    Trouble("jaw_adhesion"),
    Trouble("fibre_break"),
    Trouble("loose_grip"),
    Trouble("out_of_plane"),
    Trouble("tip_bent", where=(("tool", "left"),)),
    Trouble("light_dimmed"),
    Trouble("zoom_lost_steps"),
    Trouble("sensor_drift", where=(("amount", 0.2),)),
    Trouble("sensor_saturated", at="push the spans", lasts_s=5.0),
    Trouble("board overrun", at="push the spans"),
    Trouble("board unplugged", at="push the spans", lasts_s=5.0),
    Trouble("camera unplugged", lasts_wall_s=2.0),
    Trouble("camera lost", where=(("share", 0.3),)),
    Trouble("camera incomplete", where=(("share", 0.3),)),
    Trouble("camera frozen", lasts_wall_s=3.0),
    Trouble("controller lost_completed", at="carry to the probe", lasts_wall_s=3.0),
    Trouble("controller doubled_completed", at="carry to the probe"),
    Trouble(
        "controller end_stop",
        at="carry to the probe",
        where=(("device", 0), ("channel", 0)),
        lasts_wall_s=1.0,
    ),
    Trouble(
        "controller unplugged", at="carry to the probe", where=(("device", 0),), lasts_wall_s=3.0
    ),
)


LASTING = (
    Trouble("camera unplugged", words="microscope"),
    Trouble("camera unplugged", at="carry to the probe", words="microscope"),
    Trouble("board unplugged", at="push the spans", words="acquisition"),
    Trouble("sensor_saturated", words="force sensor"),
    Trouble("sensor_dead", words="force sensor"),
    Trouble(
        "controller unplugged", at="carry to the probe", where=(("device", 0),), words="left.x"
    ),
)
"""Left as they are."""
SOON_S = 30.0


@dataclass(frozen=True, slots=True)
class Outcomes:
    """How a campaign with one fault ended.

    Attributes
    ----------
    took_s : float
        From the fault to the end, on the platform's clock, or on the wall where that is more.
    """

    good: int
    over: bool
    reason: str
    still: bool
    contacts: int
    peak_un: float
    took_s: float = 0.0

    @property
    def recovered(self) -> bool:
        """Two fibres were measured."""
        return self.good >= 2

    @property
    def safe(self) -> bool:
        """Nothing was harmed, and it ended with a reason."""
        ended = self.over and bool(self.reason) and self.still
        return ended and not self.contacts and self.peak_un <= PEAK_UN


def try_one(
    trouble: Trouble, folder: Path, rate: float = RATE, limit_s: float = LIMIT_S
) -> Outcomes:
    """Run a campaign with one fault to its end, or until `limit_s` have passed on the wall."""
    recipe = folder / "two.toml"
    recipe.write_text(RECIPE, encoding="utf-8")
    truth = folder / "truth.jsonl"
    struck = Event()
    with cosmic.connect(rate=rate, sample="three-dry", seed=3, truth=truth) as rig:
        campaign = rig.campaign(recipe, folder / "out")

        def look() -> None:
            if campaign.operation == trouble.at and not struck.is_set():
                struck.set()
                rig.faults.inject(trouble.name, **dict(trouble.where))

        campaign.on_change(look)
        began_s = WALL.now_s()
        campaign.start()
        clock, struck_s, cleared = campaign.work.clock, (0.0, 0.0), False
        while not campaign.over and WALL.now_s() - began_s < limit_s:
            WALL.sleep(0.02)
            if not struck.is_set():
                continue
            if not any(struck_s):
                struck_s = clock.now_s(), WALL.now_s()
            passed_s = clock.now_s() - struck_s[0], WALL.now_s() - struck_s[1]
            if not cleared and trouble.is_over(*passed_s):
                rig.faults.clear(trouble.name)
                cleared, began_s = True, WALL.now_s()
        over = campaign.over
        took_s = max(clock.now_s() - struck_s[0], WALL.now_s() - struck_s[1])
        if not over:
            campaign.abort("the benchmark waited long enough")
            campaign.join()
        good = sum(each.outcome is Outcome.GOOD for each in campaign.fibres)
        still = not any(axis.details.in_motion for axis in rig.mico)
        reason = campaign.end_reason
    return replace(_scored(good, reason, truth, over=over, still=still), took_s=took_s)


def _scored(good: int, reason: str, truth: Path, *, over: bool, still: bool) -> Outcomes:
    record = read_truth(truth)
    contacts = sum(not event.facts["meant"] for event in record.of("contact over"))
    peaks = [float(event.facts.get("peak_un", 0.0)) for event in record.of("left")]
    return Outcomes(good, over, reason, still, contacts, max(peaks, default=0.0))


def measure(quick: bool = False) -> list[Figure]:
    """Return the figures of all faults."""
    figures, recovered, safe = [], 0, 0
    troubles = TROUBLES[:1] if quick else TROUBLES
    for trouble in troubles:
        with tempfile.TemporaryDirectory() as folder:
            found = try_one(trouble, Path(folder))
        recovered, safe = recovered + found.recovered, safe + found.safe
        figures += [
            Figure(NAME, f"{trouble.name}: good of 2", found.good, "fibres"),
            Figure(NAME, f"{trouble.name}: not safe", float(not found.safe), "", 0.0),
        ]
    for trouble in () if quick else LASTING:
        with tempfile.TemporaryDirectory() as folder:
            found = try_one(trouble, Path(folder), REAL_RATE, REAL_LIMIT_S)
        name = f"{trouble.name} for good, at {trouble.at}"
        print(f"{name}: {found.reason}", flush=True)
        named = found.safe and trouble.words in found.reason
        figures += [
            Figure(NAME, f"{name}: unsafe, or not named", float(not named), "", 0.0),
            Figure(NAME, f"{name}: end after", found.took_s, "s", SOON_S),
        ]
    parts = 100.0 / len(troubles)
    return [
        *figures,
        Figure(NAME, "recovered alone", parts * recovered, "%"),
        Figure(NAME, "the same, below 80 %", max(0.0, 80.0 - parts * recovered), "", 0.0),
        Figure(NAME, "ended safe", parts * safe, "%"),
        Figure(NAME, "the same, below 100 %", 100.0 - parts * safe, "", 0.0),
    ]


if __name__ == "__main__":
    main(__doc__, measure)
