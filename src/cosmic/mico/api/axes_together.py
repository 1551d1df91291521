"""Movements of several axes that are decided and started together."""

from collections.abc import Mapping
from typing import Literal, overload

from cosmic.frame.arguments import checked_class
from cosmic.frame.errors import MoveRefused
from cosmic.frame.operation import wait_or_cancel
from cosmic.frame.verdict import MoveVerdict
from cosmic.mico.api.axes import Axes
from cosmic.mico.api.axis_group import AxisGroup
from cosmic.mico.api.entry import Number, as_number
from cosmic.mico.api.group import GroupMovement
from cosmic.mico.core.motion.orders import Motion, MoveBy, MoveTo


@checked_class
class AxesTogether(Axes):
    """The axes, which can be moved and asked about together; any thread."""

    @overload
    def move(
        self,
        targets: Mapping[str, Number],
        *,
        wait: Literal[True] = True,
        consent: bool = False,
        match_arrival: bool = False,
    ) -> dict[str, float | None]: ...

    @overload
    def move(
        self,
        targets: Mapping[str, Number],
        *,
        wait: Literal[False],
        consent: bool = False,
        match_arrival: bool = False,
    ) -> GroupMovement: ...

    def move(
        self,
        targets: Mapping[str, Number],
        *,
        wait: bool = True,
        consent: bool = False,
        match_arrival: bool = False,
    ) -> dict[str, float | None] | GroupMovement:
        """Move several axes to positions together; returns the positions reached.

        They are decided together and started back to back; each goes at its own speed, so the
        path is not a straight line. The failure of one stops the others. Axes that are linked to
        them, and not named, move with them.

        Parameters
        ----------
        targets : mapping
            Positions by axis name, in the unit of each axis, from the user's zero.
        wait : bool
            False returns the `GroupMovement` at once.
        match_arrival : bool
            Slow the axes down to the one that takes longest, so that all arrive together; their
            own speeds come back afterwards.

        Raises
        ------
        MoveRefused
            The gate refused; nothing moved.
        UnknownAxisError
            One axis does not exist; nothing moved.
        DeviceError, MoveCancelled
            One of them failed or was stopped.
        """
        motions = self._targets(targets)
        return self._together(motions, wait=wait, consent=consent, match_arrival=match_arrival)

    @overload
    def move_by(
        self,
        distances: Mapping[str, Number],
        *,
        wait: Literal[True] = True,
        consent: bool = False,
        match_arrival: bool = False,
    ) -> dict[str, float | None]: ...

    @overload
    def move_by(
        self,
        distances: Mapping[str, Number],
        *,
        wait: Literal[False],
        consent: bool = False,
        match_arrival: bool = False,
    ) -> GroupMovement: ...

    def move_by(
        self,
        distances: Mapping[str, Number],
        *,
        wait: bool = True,
        consent: bool = False,
        match_arrival: bool = False,
    ) -> dict[str, float | None] | GroupMovement:
        """Move several axes by distances together; otherwise as `move`."""
        motions: dict[str, Motion] = {}
        for name, value in distances.items():
            unit = self[name].unit
            motions[name] = MoveBy(as_number(value, unit, name), unit)
        return self._together(motions, wait=wait, consent=consent, match_arrival=match_arrival)

    def _targets(self, targets: Mapping[str, Number]) -> dict[str, Motion]:
        motions: dict[str, Motion] = {}
        for name, value in targets.items():
            motions[name] = MoveTo(self._in_gate(name, value), self[name].unit)
        return motions

    def _together(
        self, motions: Mapping[str, Motion], *, wait: bool, consent: bool, match_arrival: bool
    ) -> dict[str, float | None] | GroupMovement:
        orders = self._manager.order_together(
            motions, source=self._source, consent=consent, match_arrival=match_arrival
        )
        group = GroupMovement.of(orders)
        return wait_or_cancel(group) if wait else group

    def group(self, *names: str, name: str = "") -> AxisGroup:
        """Return axes that a bluesky plan moves as one; raises `UnknownAxisError`."""
        axes = {each: self[each].movable for each in names}
        return AxisGroup(axes, lambda to: self.move(to, wait=False), self.check, name)

    def check(self, targets: Mapping[str, Number]) -> MoveVerdict:
        """Return the gate's answer to absolute targets together, without moving.

        Raises
        ------
        UnknownAxisError
            One axis does not exist.
        """
        try:
            return self._manager.check(self._targets(targets))
        except MoveRefused as exc:
            return exc.verdict

    def _in_gate(self, name: str, value: Number) -> float:
        axis = self[name]
        return as_number(value, axis.unit, name) + axis.details.zero
