"""Friction where the probe touches a fibre: along it, and up and down the probe."""

import math
from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Protocol

from typing_extensions import override

from cosmic.twin.rod import PushCurve

ROUNDS: Final = 6
LEAST_UN: Final = 1e-9
FARTHEST: Final = 0.5
"""From the middle between both frictions there is none, at most."""


@dataclass(slots=True)
class Rubbing:
    """Friction along the fibre: the contact sticks as long as friction can hold it.

    Where probe and fibre touch would slide as the fibre bends. While it sticks, probe and fibre
    give way along instead, until that takes all the friction there is. Then it slides, and sticks
    again as soon as it would slide back.

    Attributes
    ----------
    probe_un_um : float
        Stiffness of the probe along the fibre.
    turn_um : float
        By how much the contact itself gives along, from all friction one way to the other.
    part : float
        Between all friction there is, 1, which pulls the fibre outwards, and -1, inwards.
    """

    probe_un_um: float
    turn_um: float
    part: float = 0.0
    _stuck_um: float | None = None

    def follow(
        self,
        outwards: "PushCurve | HeldPush",
        inwards: "PushCurve | HeldPush",
        travel_um: float,
        back_um: float,
    ) -> float:
        """Take note of where the probe is now, and return `part`.

        Parameters
        ----------
        outwards, inwards : PushCurve or HeldPush
            With all friction that pulls the fibre outwards, and inwards.
        back_um : float
            How far the fibre stands back by what crept: it is bent by so much more.
        """
        if travel_um <= 0.0:
            self.leave()
            return 0.0
        if self._stuck_um is None:
            self._stuck_um = 0.5 * (outwards.slid_um(back_um) + inwards.slid_um(back_um))
        bent_um = travel_um + back_um
        least = outwards.slid_um(bent_um) + outwards.along_un(travel_um) / self.probe_un_um
        most = inwards.slid_um(bent_um) + inwards.along_un(travel_um) / self.probe_un_um
        middle = 0.5 * (least + most)
        # Friction always moves a fibre the way that it pulls: below 0 is rounding.
        gives = 0.5 * (max(most - least, 0.0) + self.turn_um)
        part = (middle - self._stuck_um) / gives
        if abs(part) > 1.0:
            part = math.copysign(1.0, part)
            self._stuck_um = middle - part * gives
        self.part = part
        return part

    def leave(self) -> None:
        """Take note that they do not touch."""
        self.part, self._stuck_um = 0.0, None


@dataclass(frozen=True, slots=True)
class Askew:
    """How a fibre that is pushed gives way up or down, at one place.

    Attributes
    ----------
    softer : float
        By which part it gives way less across for a force up of 1, as a part of that across.
    ratio : float
        Force up, as a part of that across, that keeps it from going up or down at all.
    up_um_un : float
        How far it goes down for a force down.
    most : float
        Part of the push that friction can have.
    """

    softer: float
    ratio: float
    up_um_un: float
    most: float


@dataclass(slots=True)
class Lifting:
    """Friction that keeps a section that stands askew from sliding up or down the probe.

    As long as friction can give the force that this takes, the contact sticks, and the fibre is as
    stiff as one that cannot go aside. Beyond, it slides, and friction has the part of the push that
    it can have. When the push falls it sticks again, until friction has turned round.

    Attributes
    ----------
    part : float
        Part of the push that it has, positive where it holds the fibre down.
    """

    part: float = 0.0
    _place_um: float = 0.0
    _height_um: float = 0.0

    def follow(
        self,
        forces_un: Callable[[float], Callable[[float], float]],
        travel_um: float,
        back_um: float,
        height_um: float,
        askew: Askew,
    ) -> float:
        """Take note of where probe and fibre are now, and return `part`.

        Parameters
        ----------
        forces_un : callable
            Makes of a travel the force across there for each `part`.
        back_um : float
            How far the fibre stands back by what crept: that alone moves no contact.
        height_um : float
            How high the fibre would be beside the probe.
        """
        crept_um = self._place_um - back_um
        rose_um = height_um - self._height_um
        self._place_um, self._height_um = travel_um + back_um, height_um
        if travel_um <= 0.0:
            self.part = 0.0
            return 0.0
        part, ratio, most = self.part, askew.ratio, askew.most
        before = max(forces_un(crept_um)(part), 0.0)
        held = part * before + rose_um / askew.up_um_un
        force_un = forces_un(travel_um)
        for _ in range(ROUNDS):
            now = force_un(part)
            slides = (held + ratio * (now - before)) / max(now, LEAST_UN)
            was, part = part, most if slides > most else max(slides, -most)
            if part == was:
                break
        self.part = part
        return part


class Push(Protocol):
    """Force over the travel of a probe."""

    @property
    @abstractmethod
    def reach_um(self) -> float:
        """Travel at which the fibre slides off."""

    @abstractmethod
    def force_un(self, travel_um: float) -> float:
        """Return the force at a travel."""

    @abstractmethod
    def along_un(self, travel_um: float) -> float:
        """Return the force along the fibre on the probe at a travel, outwards."""

    @abstractmethod
    def both_un(self, travel_um: float) -> tuple[float, float]:
        """Return both forces at a travel; each curve is asked once."""


def held_un(down_un: float, up_un: float, part: float) -> float:
    """Return the force between those of all friction down and up: what it gives way follows."""
    if not down_un * up_un > 0.0:
        return 0.0
    return 2.0 / ((1.0 + part) / down_un + (1.0 - part) / up_un)


def given_um_un(down_un: float, up_un: float) -> tuple[float, float]:
    """Return what `held_un` is the inverse of, for a part of 0, and how it grows with the part."""
    if not down_un * up_un > 0.0:
        return math.inf, 0.0
    return 0.5 / down_un + 0.5 / up_un, 0.5 / down_un - 0.5 / up_un


def between(most: float, least: float, part: float) -> float:
    """Return what lies between that of a part of 1 and that of -1."""
    return 0.5 * (most + least) + 0.5 * part * (most - least)


@dataclass(slots=True)
class HeldPush(Push):
    """A push with friction up or down: what it gives way follows between the two, evenly.

    Attributes
    ----------
    part : float
        1: all that friction may be downwards; -1: upwards.
    """

    down: PushCurve
    up: PushCurve
    part: float

    @property
    @override
    def reach_um(self) -> float:
        return min(self.down.reach_um, self.up.reach_um)

    @override
    def force_un(self, travel_um: float) -> float:
        return held_un(self.down.force_un(travel_um), self.up.force_un(travel_um), self.part)

    @override
    def along_un(self, travel_um: float) -> float:
        return self.both_un(travel_um)[1]

    @override
    def both_un(self, travel_um: float) -> tuple[float, float]:
        one, along = self.down.both_un(travel_um)
        across = held_un(one, self.up.force_un(travel_um), self.part)
        return across, across * along / one if one else 0.0

    def slid_um(self, travel_um: float) -> float:
        """Return where along the fibre the probe touches, as `PushCurve` has it."""
        return between(self.down.slid_um(travel_um), self.up.slid_um(travel_um), self.part)


@dataclass(slots=True)
class RubbedPush(Push):
    """A push between those with all friction that pulls the fibre outwards, and inwards.

    Friction moves a soft probe along, nearer to the clamp or farther, and the force across goes
    with that, not evenly: what it is without friction is between.
    """

    outwards: Push | PushCurve
    free: Push | PushCurve
    inwards: Push | PushCurve
    part: float

    @property
    @override
    def reach_um(self) -> float:
        return min(self.outwards.reach_um, self.inwards.reach_um)

    @override
    def force_un(self, travel_um: float) -> float:
        return self.both_un(travel_um)[0]

    @override
    def along_un(self, travel_um: float) -> float:
        return self.both_un(travel_um)[1]

    @override
    def both_un(self, travel_um: float) -> tuple[float, float]:
        one, along_one = self.outwards.both_un(travel_um)
        other, along_other = self.inwards.both_un(travel_um)
        across, along = (
            between(one, other, self.part),
            between(along_one, along_other, self.part),
        )
        if abs(self.part) < 1.0 and along_one != along_other:
            free, along_free = self.free.both_un(travel_um)
            at = (2.0 * along_free - along_one - along_other) / (along_one - along_other)
            at = min(max(at, -FARTHEST), FARTHEST)
            bow = (free - between(one, other, at)) / (1.0 - at * at)
            across += bow * (1.0 - self.part * self.part)
        return across, along
