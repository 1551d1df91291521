"""`MotorRecord`: an axis as EPICS knows motors, and `ValueRecord`: a measured value."""

import asyncio
from collections.abc import Awaitable, Callable
from math import inf, isfinite, nan
from typing import Any, Final, Protocol

from cosmic.app.gateways import epics_channels as ca
from cosmic.app.gateways.epics_channels import Alarm, Channel, PutRefused, Who
from cosmic.daqco.core.limits import Limit
from cosmic.frame.errors import CosmicError, MoveRefused
from cosmic.mico.core.motion.positioner import PositionerState

EDGE_S: Final = 0.05
"""Between the last position and `DMOV`: clients get monitors in bundles, and in any order."""
SETTLED_S: Final = 0.03
"""Between `DMOV` and the end of a put."""
FRESH_S: Final = 2.0
"""So long a value is one of now though no sample follows."""
LONGEST_WAVE: Final = 20_000
"""So many samples a record has; where the simulation is fast, more come at once."""
SMALLEST_STEP: Final = 0.001
"""What `MRES` and the deadband say, in units of the axis."""

HELD_WITHIN: Final = {"um": 0.5, "deg": 0.005}
"""So near its target a closed loop holds an axis; one farther off was moved by others."""

Run = Callable[[Who, str, dict[str, Any], tuple[str, ...]], Awaitable[Any]]
"""`run(who, function, arguments, keys)` carries out a command of MiCo and awaits its end."""
Look = Callable[[str], Awaitable[PositionerState]]


class Commander(Protocol):
    """Who carries out what records want."""

    async def run(
        self, who: Who, function: str, arguments: dict[str, Any], keys: tuple[str, ...]
    ) -> None:
        """Carry out a command of MiCo and await its end; raises `CosmicError`."""

    async def look(self, axis: str) -> PositionerState:
        """Return the newest state of an axis."""

    def may_move(self, who: Who) -> bool:
        """Return whether a client holds the right to move."""


class MotorRecord:
    """A motor record in front of one axis; in the loop of the server.

    VAL and RBV count from the user's zero, DVAL and DRBV in gate coordinates. A put to VAL ends
    when the axis is at rest; what is refused fails the put, and raises the alarm of RBV. VAL and
    DVAL say where it was sent; where it rests otherwise, as after a stop, they follow it, so that
    what is relative to them begins where the axis is.

    Parameters
    ----------
    name : str
        Of the record, such as "COSMIC:left_x".
    step : float
        About how far one step goes, in units of the axis; only `VELO` and `VMAX` are made of it.
    """

    def __init__(
        self,
        name: str,
        axis: str,
        state: PositionerState,
        commander: Commander,
        step: float,
    ) -> None:
        self._axis = axis
        self._unit = state.unit
        self._zero = state.zero
        self._newest = state
        self._commander = commander
        self._moves = 0
        self._begun = 0
        self._target = state.position or 0.0
        self._in_motion = state.in_motion
        self._showing = asyncio.Lock()
        self._edge = asyncio.Lock()
        self._alarm: Alarm = ca.NO_ALARM
        limits = state.limits or (0.0, 0.0)
        place = state.position or 0.0
        units = "um" if state.unit == "um" else "deg"

        def axis_number(value: float, put: ca.Put | None = None) -> Channel:
            return ca.number(value, put=put, units=units, limits=limits)

        self._fields: dict[str, Channel] = {
            "VAL": axis_number(place - state.zero, self._go),
            "RBV": axis_number(place - state.zero),
            "DVAL": axis_number(place, self._go_dial),
            "DRBV": axis_number(place),
            "RLV": axis_number(0.0, self._go_by),
            "TWV": axis_number(1.0, self._set_step),
            "TWF": ca.whole(put=self._tweak(1.0)),
            "TWR": ca.whole(put=self._tweak(-1.0)),
            "STOP": ca.whole(put=self._halt, otherwise=1),
            "DMOV": ca.whole(1),
            "MOVN": ca.whole(0),
            "HLM": axis_number(limits[1]),
            "LLM": axis_number(limits[0]),
            "DHLM": axis_number(limits[1]),
            "DLLM": axis_number(limits[0]),
            "OFF": axis_number(-state.zero),
            "VELO": axis_number(step * state.frequency_range_hz[1]),
            "VMAX": axis_number(step * state.frequency_range_hz[1]),
            "EGU": ca.line(units),
            "DESC": ca.line(state.name),
            "DIR": ca.choice(("Pos", "Neg")),
            "FOFF": ca.choice(("Variable", "Frozen"), 1),
            "SET": ca.choice(("Use", "Set")),
            "SPMG": ca.choice(("Stop", "Pause", "Move", "Go"), 3),
            "ACCL": ca.number(0.1),
            "MRES": ca.number(SMALLEST_STEP),
            "ERES": ca.number(SMALLEST_STEP),
            "SREV": ca.whole(1000),
            "UREV": ca.number(1.0),
            "RDBD": ca.number(SMALLEST_STEP),
            "PREC": ca.whole(4),
            "HLS": ca.whole(0),
            "LLS": ca.whole(0),
            "TDIR": ca.whole(0),
            "HOMF": ca.whole(put=self._home),
            "HOMR": ca.whole(put=self._home),
            "OUT": ca.line("@cosmic"),
            "RTYP": ca.line("motor"),
            "STAT": ca.whole(0),
            "SEVR": ca.whole(0),
        }
        self._reason = ca.text(length=500)
        self.channels = {name: self._fields["VAL"], f"{name}:reason": self._reason}
        self.channels |= {f"{name}.{field}": each for field, each in self._fields.items()}

    async def show(self, state: PositionerState | None = None) -> None:
        """Show the axis as it is; None: as it was shown last, with the alarm of now."""
        async with self._showing:  # an alarm of before must not be written after a newer one
            found = self._newest if state is None else state  # not older than what is shown now
            await self._show_state(found)
        moved, self._in_motion = self._in_motion, found.in_motion
        if not self._moves:
            if not found.in_motion and (moved or self._left_its_target(found)):
                await self._rest(found)  # somebody else moved it
            await self._show_moving()

    async def _show_state(self, state: PositionerState) -> None:
        self._zero, self._newest = state.zero, state
        fields, alarm = self._fields, self._state_alarm(state)
        low, high = state.limits or (0.0, 0.0)
        shown, dial = (low - state.zero, high - state.zero), (low, high)
        if state.position is not None:
            await ca.show(fields["RBV"], state.position - state.zero, alarm, **_within(shown))
            await ca.show(fields["DRBV"], state.position, alarm, **_within(dial))
        else:
            await ca.show(fields["RBV"], fields["RBV"].value, alarm)
        await self._show_target()
        await ca.show(fields["STAT"], int(alarm[0]))
        await ca.show(fields["SEVR"], int(alarm[1]))
        ends = ("LLM", shown[0]), ("HLM", shown[1]), ("DLLM", low), ("DHLM", high)
        for field, value in ends:
            await ca.show(fields[field], value)
        await ca.show(fields["OFF"], -state.zero)

    async def _show_target(self) -> None:
        low, high = self._newest.limits or (0.0, 0.0)
        for field, zero in (("VAL", self._zero), ("DVAL", 0.0)):
            bounds = _within((low - zero, high - zero))
            await ca.show(self._fields[field], self._target - zero, ca.NO_ALARM, **bounds)

    def _left_its_target(self, state: PositionerState) -> bool:
        there = state.position
        return there is not None and abs(there - self._target) > HELD_WITHIN[self._unit]

    async def _rest(self, state: PositionerState) -> None:
        """Have the target be where the axis is."""
        if state.position is not None:
            self._target = state.position
        await self._show_target()

    async def forget(self, reason: str) -> None:
        """Take the alarm of a refusal away whose cause is no more, such as "STOPPED"."""
        if self._alarm == ca.ALARMS[reason]:
            self._alarm = ca.NO_ALARM
            await ca.show(self._reason, "")
            await self.show()

    async def _show_moving(self) -> None:
        async with self._edge:  # one that says "done" late must not end the next move
            moving = self._moves > 0 or self._in_motion
            await ca.show(self._fields["MOVN"], int(moving))
            await ca.show(self._fields["DMOV"], int(not moving))

    def _state_alarm(self, state: PositionerState) -> Alarm:
        if state.error or not state.present:
            return ca.FAULT
        return ca.UNKNOWN if state.position is None else self._alarm

    # What is written

    async def _go(self, who: Who, value: float) -> None:
        await self._move(who, self._to(value + self._zero), value + self._zero)

    async def _go_dial(self, who: Who, value: float) -> None:
        await self._move(who, self._to(value), value)

    async def _go_by(self, who: Who, value: float) -> None:
        motion = {"kind": "MoveBy", "distance": float(value), "unit": self._unit}
        await self._move(who, motion, None)

    def _to(self, target: float) -> dict[str, Any]:
        return {"kind": "MoveTo", "target": float(target), "unit": self._unit}

    def _tweak(self, sign: float) -> ca.Put:
        async def tweak(who: Who, value: int) -> None:
            if value:
                await self._go_by(who, sign * float(self._fields["TWV"].value))

        return tweak

    async def _set_step(self, who: Who, value: float) -> None:
        if not self._commander.may_move(who):  # it would change how far another's tweak goes
            raise PutRefused("a step is set by who has the right to move")
        if not isfinite(value):
            raise PutRefused("a step is a finite number")
        await self._fields["TWV"].write(value, verify_value=False)

    async def _home(self, who: Who, value: int) -> None:
        if value:
            await self._move(who, {"kind": "Reference"}, None)

    async def _halt(self, who: Who, value: int) -> None:
        if value:
            await self._commander.run(who, "axes.halt", {"why": "stop from EPICS"}, (self._axis,))

    async def _move(self, who: Who, motion: dict[str, Any], target: float | None) -> None:
        """Carry out one motion; the record says that it moves until the axis is at rest.

        Parameters
        ----------
        target : float or None
            In gate coordinates; None where only the end of the motion tells.
        """
        allowed = self._commander.may_move(who)
        if self._moves and not allowed:
            raise PutRefused("it moves for another client")  # who is not to notice
        self._moves += 1
        self._begun += 1
        number = self._begun
        try:
            self._alarm = ca.NO_ALARM
            if target is not None and isfinite(target):
                self._target = target  # beyond the limits too: the gate refuses it, with its alarm
                await self._show_target()
            await self._show_moving()
            failure = await self._failure(who, motion)
            if number == self._begun:  # else a newer one has replaced it, and says how it goes
                self._alarm = _alarm_of(failure)
                await ca.show(self._reason, "" if failure is None else str(failure)[:499])
            # Whoever may not move has moved nothing; many of them are not to keep others waiting.
            await self.show(await self._commander.look(self._axis) if allowed else None)
            if (failure is not None or target is None) and self._moves == 1:
                await self._rest(self._newest)
            await asyncio.sleep(EDGE_S)
        finally:
            self._moves -= 1
            await self._show_moving()
        await asyncio.sleep(SETTLED_S)
        if failure is not None:
            raise PutRefused(str(failure))

    async def _failure(self, who: Who, motion: dict[str, Any]) -> CosmicError | None:
        try:
            await self._commander.run(who, "axes.begin", {"motion": motion}, (self._axis,))
        except CosmicError as exc:
            return exc
        return None


def _within(limits: tuple[float, float]) -> dict[str, float]:
    """Return limits as clients read them with a value."""
    low, high = limits
    return {
        "lower_ctrl_limit": low,
        "upper_ctrl_limit": high,
        "lower_disp_limit": low,
        "upper_disp_limit": high,
    }


def _alarm_of(failure: CosmicError | None) -> Alarm:
    if failure is None:
        return ca.NO_ALARM
    reason = failure.verdict.reason.name if isinstance(failure, MoveRefused) else ""
    return ca.ALARMS.get(reason, ca.FAULT)


class ValueRecord:
    """The newest value of a channel of DAQCo with the limits in force, and its newest samples.

    A value that no sample follows is not that of now: it has an alarm, as one that nobody knows.
    """

    def __init__(self, name: str, unit: str) -> None:
        self._value = ca.number(units=unit)
        self._wave = ca.wave(LONGEST_WAVE, unit)
        self._unit = ca.line(unit)
        self._ends = {"HIHI": ca.number(nan), "LOLO": ca.number(nan)}
        self._alarms = {"STAT": ca.whole(), "SEVR": ca.whole()}
        self._newest_s, self._stale = -inf, False
        self.channels = {
            name: self._value,
            f"{name}.VAL": self._value,
            f"{name}.EGU": self._unit,
            f"{name}:wave": self._wave,
        }
        fields = {**self._ends, **self._alarms}
        self.channels |= {f"{name}.{field}": each for field, each in fields.items()}

    async def show(self, samples: Any, unit: str, limit: Limit | None, now_s: float) -> None:
        """Show samples in physical units; one beyond an armed limit is an alarm."""
        self._newest_s, self._stale = now_s, False
        value, armed = float(samples.mean()), limit is not None and limit.armed
        low, high = (limit.low, limit.high) if limit is not None and armed else (-inf, inf)
        alarm = ca.NO_ALARM
        if not isfinite(value):
            alarm = ca.UNKNOWN
        elif float(samples.max()) > high:
            alarm = ca.TOO_HIGH
        elif float(samples.min()) < low:
            alarm = ca.TOO_LOW
        elif limit is not None and limit.tripped:
            alarm = ca.FAULT
        ends = {"HIHI": high if high < inf else nan, "LOLO": low if low > -inf else nan}
        bounds = {"upper_alarm_limit": ends["HIHI"], "lower_alarm_limit": ends["LOLO"]}
        for field, each in ends.items():
            await ca.show(self._ends[field], each)
        await self._show_alarm(alarm)
        await ca.show(self._value, value, alarm, units=unit, **bounds)
        await ca.show(self._wave, samples[-LONGEST_WAVE:], alarm)
        await ca.show(self._unit, unit[:39])

    async def look(self, now_s: float) -> None:
        """Say so where no sample came for too long."""
        if self._stale or now_s - self._newest_s <= FRESH_S:
            return
        self._stale = True
        await self._show_alarm(ca.UNKNOWN)
        for channel in (self._value, self._wave):
            await ca.show(channel, channel.value, ca.UNKNOWN)

    async def _show_alarm(self, alarm: Alarm) -> None:
        await ca.show(self._alarms["STAT"], int(alarm[0]))
        await ca.show(self._alarms["SEVR"], int(alarm[1]))
