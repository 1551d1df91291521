"""A contact that sticks before it slides, along the fibre.

A probe that gives way along a curled fibre is taken along by it as long as friction can hold both
together. Where the contact would wander, friction grows just so far that it does not; only what
friction cannot hold slides. So friction of the way out may be less than there could be, and on the
way back it turns round by and by.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from cosmic.autonomy.bending.result import SpanFit
from cosmic.autonomy.bending.settings import FitSettings
from cosmic.frame.arrays import Floats

NEWTON: Final = 3
"""Steps until friction is found with which a contact stays where it is."""

LEAST_UM: Final = 1e-9
"""By which friction moves the contact: where it is less, the contact slides at once."""

LAID_FRICTION: Final = 0.3
"""Friction that curves are laid out for at least; less of it is a part."""

FRICTIONS_TRIED: Final = (0.03, 0.07, 0.12, 0.2, 0.3, 0.42, 0.56, 0.72)
"""Frictions that the shapes of curves are compared with."""

GIVES_TRIED: Final = (0.5, 1.0, 2.0)
"""Of what the probe is taken to give way along the fibre: what else curves are compared with."""

STEP: Final = 0.005
"""Of friction: how finely it is sought between those."""

LIKE_STD: Final = 0.03
"""Of friction: how well one stands for all fibres of a campaign, and for the whole of a push."""

LEAST_SIDE: Final = 1e-3
"""Of what a probe gives way aside: no such thing is known better."""

UNLIKE_PART: Final = 0.1
"""Of friction: by how much it differs between fibres."""

MISLEADS: Final = math.log(0.02)
"""How likely it is that something else has bent the curve of a span, as a logarithm."""


HARDLY: Final = 3
"""Of `FRICTIONS_TRIED`: with less than this it turns round on so short a way that the contact may
well slide at once."""

STICKS_BY: Final = 2.0
"""Of a logarithm: so much more likely a contact that hardly sticks must be than one that never
does, to be believed."""

BEFORE_TOP: Final = (0.94, 0.97, 0.985, 0.995, 1.0)
"""Of the travel at which a push turns back: friction may turn round on a very short way."""


class Friction(NamedTuple):
    """What is known of friction between probe and fibre along it.

    Attributes
    ----------
    friction, std : float
        Part of the normal force, and its standard deviation.
    gives : float
        How far the probe gives way along the fibre, as a part of what it was taken to.
    slides : bool
        The contact never sticks: something shakes it.
    """

    friction: float
    std: float
    gives: float = 1.0
    slides: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class Contact:
    """What one span does with friction one way, without any, and with friction the other way.

    Attributes
    ----------
    travel_um : ndarray, shape (n,), float64
        Of the probe's edge since the first contact; rises from 0.
    pushed, slid_um : ndarray, shape (3, n), float64
        Force across, and how far the contact has slid along the fibre.
    """

    travel_um: Floats
    pushed: Floats
    slid_um: Floats

    def with_top(self, top_um: float) -> "Contact":
        """Return the same at more travels, those where a push turns back among them."""
        travel = np.sort(np.concatenate([self.travel_um, top_um * np.array(BEFORE_TOP)]))
        pushed, slid = (
            np.array([np.interp(travel, self.travel_um, each) for each in rows])
            for rows in (self.pushed, self.slid_um)
        )
        return Contact(travel, pushed, slid)


Branches = tuple[Floats, Floats]
"""Force across on the way out and on the way back, at each travel."""


def pushed_out_and_back(
    contacts: Sequence[Contact], tops_um: Sequence[float], parts: Sequence[float]
) -> tuple[tuple[Branches, ...], ...]:
    """Return what each contact answers for each part of the friction.

    Parameters
    ----------
    contacts : sequence of Contact
        All with as many travels.
    tops_um : sequence of float
        Travel at which each turns back, one of its own; beyond, both ways are one.
    parts : sequence of float
        Of the friction that the contacts were found with: so much is there.
    """
    every = [each for _ in parts for each in contacts]
    slid = np.stack([each.slid_um for each in every], axis=-1)
    pushed = np.stack([each.pushed for each in every], axis=-1)
    travel = np.stack([each.travel_um for each in every], axis=-1)
    tops = np.tile(np.asarray(tops_um, dtype=np.float64), len(parts))
    most = np.repeat(np.asarray(parts, dtype=np.float64), len(contacts))
    loads = len(travel)
    out, stayed = np.zeros_like(travel), np.zeros_like(travel)
    stays = stayed[0] = slid[1, 0]
    for load in range(1, loads):
        out[load] = _held(slid[:, load], stays, most)
        stays = stayed[load] = _at(slid[:, load], out[load])
    back = out.copy()
    top = np.argmax(travel >= tops, axis=0)
    stays = stayed[top, np.arange(len(tops))]
    for load in range(loads - 1, 0, -1):
        below = travel[load] < tops
        back[load] = np.where(below, _held(slid[:, load], stays, most), out[load])
        stays = np.where(below, _at(slid[:, load], back[load]), stays)
    branches = list(zip(_at(pushed, out).T, _at(pushed, back).T, strict=True))
    count = len(contacts)
    return tuple(tuple(branches[n : n + count]) for n in range(0, len(branches), count))


def slid_out_and_back(contact: Contact, top_um: float, part: float) -> Branches:
    """Return what `pushed_out_and_back` does for a contact that never sticks."""
    ahead, none, back = (np.interp(top_um, contact.travel_um, each) for each in contact.slid_um)
    # Friction of the way out holds the contact back from where it would wander.
    sign = part if (ahead < back) == (none > contact.slid_um[1, 0]) else -part
    return _at(contact.pushed, sign), _at(contact.pushed, -sign)


def _held(slid: Floats, stays: Floats, most: Floats) -> Floats:
    """Return the part of friction with which contacts stay, or come nearest to it; shape (n,)."""
    straight, bent = 0.5 * (slid[0] - slid[2]), 0.5 * (slid[0] + slid[2]) - slid[1]
    found = np.zeros(len(stays))
    for _ in range(NEWTON):
        left = stays - _at(slid, found)
        slope = straight + 2.0 * bent * found
        slope = np.where(np.abs(slope) < LEAST_UM, np.copysign(LEAST_UM, slope), slope)
        found = np.clip(found + left / slope, -most, most)
    return np.asarray(found)


def _at(values: Floats, part: Floats | float) -> Floats:
    """Return values for a part of friction, from those with all of it, none, and all back."""
    ahead, none, back = values
    return np.asarray(none + part * (0.5 * (ahead - back) + part * (0.5 * (ahead + back) - none)))


def known_friction(
    fits: Sequence[SpanFit],
    settings: FitSettings,
    *,
    gives_log: float = 0.0,
    may_slide: bool = True,
) -> Friction:
    """Return what the shapes of curves say of friction, beside what is known beforehand.

    The travel on which friction turns round grows with it, and with what the probe gives way: that
    shows in single curves, whatever stiffness and contact are.

    Parameters
    ----------
    gives_log : float
        By how much more than the settings have it the probe gave way where these were fitted, ln.
    may_slide : bool
        Contacts that never stick are looked for as well.
    """
    logs = np.zeros(len(GIVES_TRIED) * len(FRICTIONS_TRIED) + 1)
    for each in fits:
        if each.chi2_by_friction:
            chi2 = np.array(each.chi2_by_friction)
            # What does not fit with any friction says little about it.
            excess = max(1.0, float(chi2.min()) / max(each.freedom, 1))
            logs += np.logaddexp(-0.5 * (chi2 - chi2.min()) / excess, MISLEADS)
    if not logs.any():
        return Friction(settings.friction, settings.friction_std)
    sticks = logs[:-1].reshape(len(GIVES_TRIED), len(FRICTIONS_TRIED))
    likely = sticks.max(axis=0)
    best = int(likely.argmax())
    if may_slide and max(likely[0], logs[-1]) > likely[best] - (
        STICKS_BY if best < HARDLY else 0.0
    ):
        # What hardly sticks and what never does look alike: how far loops are open tells then.
        return Friction(settings.friction, settings.friction_std, slides=True)
    from scipy.interpolate import PchipInterpolator  # half a second, at the first fit

    rubs, gives = np.arange(FRICTIONS_TRIED[0], FRICTIONS_TRIED[-1], STEP), np.log(GIVES_TRIED)
    likely = PchipInterpolator(FRICTIONS_TRIED, sticks, axis=1)(rubs)
    believed = (rubs - settings.friction) / max(settings.friction_std, STEP)
    likely = likely - 0.5 * believed**2
    likely -= 0.5 * ((gives[:, None] + gives_log) / max(settings.side_std_part, LEAST_SIDE)) ** 2
    weights = np.exp(likely - likely.max())
    weights /= weights.sum()
    of_rubs, of_sides = weights.sum(axis=0), weights.sum(axis=1)
    mean = float(of_rubs @ rubs)
    std = math.hypot(float(np.sqrt(of_rubs @ (rubs - mean) ** 2)), LIKE_STD, UNLIKE_PART * mean)
    return Friction(mean, min(std, settings.friction_std), math.exp(float(of_sides @ gives)))
