"""What will happen to a fibre between one grasp and the next, drawn when the jaws close."""

import math
import random
from dataclasses import dataclass, replace

from cosmic.twin.force_settings import ContactSettings
from cosmic.twin.handling_settings import HandlingSettings


@dataclass(frozen=True, slots=True)
class Fate:
    """One grasp and what follows from it; nothing here depends on when it happens.

    Attributes
    ----------
    depth_um : float
        How far inside the jaws the fibre is really held.
    missed : bool
        The jaws close and it stays where it is.
    slip_at_um : float
        Height above the plate at which it slips out while it is lifted; inf: it does not.
    drop_after_um : float
        Way after lifting at which it falls; inf: it does not.
    sticks : bool
        It stays at a jaw when they open.
    rise : float
        By how much it points up, um for each um.
    break_strain, loosen_strain : float
        Strain at the clamp at which it breaks, and the grip gives way.
    loosen_um : float
        By how much.
    grip_un : float
        Pull at which it slips out while it is lifted.
    roll_rad : float
        By how much it rolls in the jaws.
    """

    depth_um: float
    missed: bool = False
    slip_at_um: float = math.inf
    drop_after_um: float = math.inf
    sticks: bool = False
    rise: float = 0.0
    break_strain: float = math.inf
    loosen_strain: float = math.inf
    loosen_um: float = 0.0
    grip_un: float = math.inf
    roll_rad: float = 0.0


def draw_fate(
    handling: HandlingSettings,
    contact: ContactSettings,
    key: str,
    *,
    faults: bool,
    grasps: int = 0,
) -> Fate:
    """Return the fate of one grasp.

    Parameters
    ----------
    key : str
        Names seed, fibre and which grasp of it this is: the same key, the same fate.
    faults : bool
        Whether anything goes wrong by chance.
    grasps : int
        How often the fibre was taken before.
    """
    chance = random.Random(f"grasp {key}")
    depth = max(chance.gauss(contact.clamp_depth_um, contact.clamp_depth_spread_um), 0.0)
    jaws = random.Random(f"jaws {key}")
    deep, grip, rolls, roll = jaws.gauss(0, 1), jaws.gauss(0, 1), jaws.random(), jaws.random()
    if contact.clamp_depth_sigma_ln:
        depth = contact.clamp_depth_um * math.exp(contact.clamp_depth_sigma_ln * deep)
    held = Fate(
        depth + contact.clamp_depth_per_grasp_um * grasps,
        break_strain=handling.break_strain,
        grip_un=contact.jaw_grip_un * math.exp(contact.jaw_grip_sigma_ln * grip),
        roll_rad=math.pi * roll if rolls < contact.roll_share else 0.0,
    )
    if not faults:
        return held
    # Every number is drawn, needed or not, so that another rate changes nothing else.
    missed, slips, drops, sticks = (chance.random() for _ in range(4))
    lifted, loosens, breaks = (chance.random() for _ in range(3))
    slip_at = chance.uniform(handling.slip_low_um, handling.slip_high_um)
    drop_after = chance.uniform(handling.drop_low_um, handling.drop_high_um)
    weak = chance.uniform(handling.weak_strain_low, handling.weak_strain_high)
    tilt = chance.gauss(0.0, handling.tilt_deg)
    steep = chance.choice((-1.0, 1.0)) * chance.uniform(0.6, 1.4) * handling.out_of_plane_deg
    if lifted < handling.out_of_plane:
        tilt = steep
    return replace(
        held,
        missed=missed < handling.missed_grasp,
        slip_at_um=slip_at if slips < handling.slip_in_lift else math.inf,
        drop_after_um=drop_after if drops < handling.drop else math.inf,
        sticks=sticks < handling.jaw_adhesion,
        rise=math.tan(math.radians(max(min(tilt, 60.0), -60.0))),
        break_strain=weak if breaks < handling.fibre_break else handling.break_strain,
        loosen_strain=weak if loosens < handling.loose_grip else math.inf,
        loosen_um=chance.uniform(handling.loosen_low_um, handling.loosen_high_um),
    )
