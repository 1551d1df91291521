"""From what a device says to how fast each positioner goes; pure."""

import math
from abc import abstractmethod
from collections.abc import Mapping
from typing import Final, Protocol

from typing_extensions import override

from cosmic.mico.core.teleoperation.settings import (
    TeleoperationAxisSettings,
    TeleoperationProfileSettings,
)
from cosmic.mico.hw.input_device import InputState

FOLLOW_PER_S: Final = 4.0
"""How fast a positioner in position mode closes in: this part of what is left, each second."""
NEAR: Final = 0.002
"""Part of the travel within which such a positioner counts as there."""


class Converter(Protocol):
    """Turns inputs into movements; input thread. A station may put its own in between."""

    @abstractmethod
    def convert(self, inputs: InputState, *, fine: bool) -> Mapping[str, float]:
        """Return the wanted velocity of each positioner, in its unit per second or Hz."""


class PositionOf(Protocol):
    """Says where a positioner is, in gate coordinates; None while nobody knows."""

    @abstractmethod
    def __call__(self, positioner: str) -> float | None:
        """Return the place of `positioner`."""


def shaped(value: float, dead_zone: float) -> float:
    """Return a deflection of -1 to 1 with nothing in the dead zone and no jump at its end."""
    size = abs(value)
    if not size > dead_zone:
        return 0.0
    return math.copysign(min(1.0, (size - dead_zone) / (1.0 - dead_zone)), value)


class ProfileMapping(Converter):
    """What the inputs of one profile move.

    Parameters
    ----------
    usual : mapping of float
        Speed limit of each positioner that the profile gives none.
    position_of : callable
        Where a positioner is, for those that follow a position.
    """

    def __init__(
        self,
        profile: TeleoperationProfileSettings,
        usual: Mapping[str, float],
        position_of: PositionOf,
    ) -> None:
        self._profile = profile
        self._limits: dict[str, float] = {}
        for each in profile.axis:
            limit = each.speed or usual[each.positioner]
            self._limits[each.positioner] = max(limit, self._limits.get(each.positioner, 0.0))
        self._usual = usual
        self._position_of = position_of
        self._origins: dict[str, float] = {}

    @property
    def profile(self) -> TeleoperationProfileSettings:
        """What it was made of."""
        return self._profile

    @property
    def positioners(self) -> tuple[str, ...]:
        """What it can move, each once."""
        return tuple(self._limits)

    def deflected(self, inputs: InputState) -> bool:
        """Return True while any input that moves something is out of its dead zone."""
        return any(self._part(each, inputs) for each in self._profile.axis)

    def recentre(self) -> None:
        """Let positioners that follow a position begin from where they are."""
        self._origins.clear()

    @override
    def convert(self, inputs: InputState, *, fine: bool) -> dict[str, float]:
        wanted = dict.fromkeys(self._limits, 0.0)
        share = self._profile.fine_share if fine else 1.0
        for each in self._profile.axis:
            if each.mode == "position":
                wanted[each.positioner] = self._follow(each, inputs, share)
            else:
                speed = each.speed or self._usual[each.positioner]
                wanted[each.positioner] += self._part(each, inputs) * speed * share
        return {name: max(-limit, min(limit, wanted[name])) for name, limit in self._limits.items()}

    @staticmethod
    def _part(each: TeleoperationAxisSettings, inputs: InputState) -> float:
        """Return the deflection of one input, -1 to 1."""
        raw = inputs.axes.get(each.input)
        if raw is None:
            raw = float(inputs.buttons.get(each.input, False))
        value = each.scale * each.direction * shaped(raw, each.dead_zone)
        return max(-1.0, min(1.0, value))

    def _follow(self, each: TeleoperationAxisSettings, inputs: InputState, share: float) -> float:
        """Return the velocity that takes a positioner to where the device is, from its origin."""
        place, travel = self._position_of(each.positioner), each.travel or 0.0
        part = self._part(each, inputs)
        if place is None:
            return 0.0
        origin = self._origins.setdefault(each.positioner, place - share * travel * part)
        left = origin + share * travel * part - place
        return 0.0 if abs(left) < NEAR * travel else FOLLOW_PER_S * left
