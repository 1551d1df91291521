"""A motor record while others write to it who may not move anything."""

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import replace
from typing import Any

from caproto import CAStatus, ChannelType

from cosmic.app.gateways import epics_channels as ca
from cosmic.app.gateways.epics_channels import Who
from cosmic.app.gateways.epics_motor import MotorRecord
from cosmic.frame.errors import CosmicError, MoveCancelled, refusal
from cosmic.frame.verdict import Reason, refuse
from cosmic.mico.core.motion.positioner import PositionerState
from cosmic.mico.hw.interface import Channel, PositionerKind

DONE = int(CAStatus.ECA_NORMAL.value.code_with_severity)
HOLDER = Who(("127.0.0.1", 1), "here", "holder")
STRANGER = Who(("127.0.0.1", 2), "there", "stranger")
STATE = PositionerState(
    "left.x", Channel(0, 0), PositionerKind.LINEAR, "um", limits=(-100.0, 100.0), position=0.0
)


class Commander:
    """Moves for the holder until `arrive` is set; counts what it is asked for."""

    def __init__(self) -> None:
        self.looks = 0
        self.runs = 0
        self.refused: CosmicError | None = None
        self.state = STATE
        self.arrive = asyncio.Event()

    async def run(
        self, who: Who, _function: str, _arguments: dict[str, Any], _keys: tuple[str, ...]
    ) -> None:
        self.runs += 1
        if who != HOLDER:
            raise refusal(refuse(Reason.NO_LEASE, "the right to move is held by holder"))
        await self.arrive.wait()
        if self.refused is not None:
            raise self.refused

    async def look(self, _axis: str) -> PositionerState:
        self.looks += 1
        return self.state

    def may_move(self, who: Who) -> bool:
        return who == HOLDER


async def put(record: MotorRecord, who: Who, value: float, field: str = "VAL") -> bool:
    """Write to a field as the server does; False where it was refused."""
    channel = record.channels[f"R.{field}"]
    status = await channel.auth_write(
        who.host, who.user, [value], channel.data_type, None, user_address=who.address
    )
    return bool(status == DONE)


def with_record(act: Callable[[MotorRecord, Commander], Awaitable[None]]) -> None:
    async def body() -> None:
        commander = Commander()
        await act(MotorRecord("R", "left.x", STATE, commander, 0.5), commander)

    asyncio.run(body())


def test_who_may_not_move_changes_nothing_while_it_moves_for_another() -> None:
    async def act(record: MotorRecord, commander: Commander) -> None:
        moving = asyncio.ensure_future(put(record, HOLDER, 10.0))
        await asyncio.sleep(0.01)
        shown = {name: each.value for name, each in record.channels.items()}
        assert shown["R.DMOV"] == 0
        for _ in range(20):
            assert not await put(record, STRANGER, -50.0)
        assert {name: each.value for name, each in record.channels.items()} == shown
        assert record.channels["R.RBV"].alarm.severity == ca.NO_ALARM[1]
        assert (commander.runs, commander.looks) == (1, 0), "nobody waits for what was refused"
        commander.arrive.set()
        assert await moving
        assert record.channels["R.DMOV"].value == 1
        assert record.channels["R.VAL"].value == 10.0

    with_record(act)


def test_a_refused_put_at_rest_is_shown_and_keeps_nobody_waiting() -> None:
    async def act(record: MotorRecord, commander: Commander) -> None:
        assert not await put(record, STRANGER, -50.0)
        assert record.channels["R.RBV"].alarm.status == ca.ALARMS["NO_LEASE"][0]
        assert record.channels["R.DMOV"].value == 1
        assert (commander.runs, commander.looks) == (1, 0)
        commander.arrive.set()
        assert await put(record, HOLDER, 10.0)
        assert record.channels["R.RBV"].alarm.severity == ca.NO_ALARM[1]
        assert commander.looks == 1

    with_record(act)


def test_a_new_target_in_motion_raises_no_alarm_and_a_refused_one_keeps_its_own() -> None:
    async def act(record: MotorRecord, commander: Commander) -> None:
        first = asyncio.ensure_future(put(record, HOLDER, 50.0))
        await asyncio.sleep(0.01)
        replaced, commander.arrive = commander.arrive, asyncio.Event()
        second = asyncio.ensure_future(put(record, HOLDER, -20.0))
        await asyncio.sleep(0.01)
        commander.refused = MoveCancelled("left.x: replaced by a newer command")
        replaced.set()
        assert not await first, "who put it first is told"
        channel = record.channels["R.RBV"]
        assert channel.alarm.severity == ca.NO_ALARM[1], "the axis moves as it shall"
        assert values(record, "DMOV", "VAL") == [0.0, -20.0]
        commander.refused = refusal(refuse(Reason.LIMIT, "outside its limit"))
        going, commander.arrive = commander.arrive, asyncio.Event()
        commander.arrive.set()
        assert not await put(record, HOLDER, 5000.0)
        commander.refused = None
        going.set()
        assert await second
        assert (channel.alarm.status, channel.alarm.severity) == ca.ALARMS["LIMIT"]

    with_record(act)


def test_an_alarm_after_another_one_is_an_alarm() -> None:
    channel = ca.number(units="um")

    async def body() -> None:
        for name in ("STOPPED", "NO_LEASE", "LIMIT"):
            await ca.show(channel, 19.8, ca.ALARMS[name])
            assert (channel.alarm.status, channel.alarm.severity) == ca.ALARMS[name]
        await ca.show(channel, 19.8)
        assert channel.alarm.severity == 0

    asyncio.run(body())


def test_an_older_state_that_is_slow_to_write_takes_no_newer_alarm_away() -> None:
    async def act(record: MotorRecord, _commander: Commander) -> None:
        channel = record.channels["R.RBV"]
        write, late = channel.write, asyncio.Event()

        async def slow(value: object, **more: Any) -> None:
            if not late.is_set():
                late.set()
                await asyncio.sleep(0.05)
            await write(value, **more)

        channel.write = slow
        older = asyncio.create_task(record.show(replace(STATE, position=3.0)))
        await late.wait()
        assert not await put(record, STRANGER, 5.0)
        await older
        assert (channel.alarm.status, channel.alarm.severity) == ca.ALARMS["NO_LEASE"]

    with_record(act)


def values(record: MotorRecord, *names: str) -> list[float]:
    return [float(record.channels[f"R.{name}"].value) for name in names]


def test_a_stop_is_carried_out_whatever_is_put() -> None:
    async def act(record: MotorRecord, commander: Commander) -> None:
        commander.arrive.set()
        for number, value in enumerate(([1], [7.5], [1, 2], [b"halt!"]), 1):
            kind = ChannelType.STRING if isinstance(value[0], bytes) else ChannelType.DOUBLE
            status = await record.channels["R.STOP"].auth_write(
                HOLDER.host, HOLDER.user, value, kind, None, user_address=HOLDER.address
            )
            assert status == DONE
            assert commander.runs == number

    with_record(act)


def test_a_setpoint_follows_an_axis_that_others_moved() -> None:
    async def act(record: MotorRecord, _commander: Commander) -> None:
        await record.show(replace(STATE, position=20.0, in_motion=True))
        assert values(record, "VAL", "DVAL") == [0.0, 0.0]
        await record.show(replace(STATE, position=30.0))
        assert values(record, "VAL", "DVAL") == [30.0, 30.0]
        await record.show(replace(STATE, position=33.0))  # too fast to be seen in motion
        assert values(record, "VAL", "DVAL") == [33.0, 33.0]
        await record.show(replace(STATE, position=33.2))  # held there
        assert values(record, "VAL", "DVAL") == [33.0, 33.0]

    with_record(act)


def test_a_setpoint_is_where_the_axis_rests_after_a_stop_and_after_a_refusal() -> None:
    async def act(record: MotorRecord, commander: Commander) -> None:
        commander.arrive.set()
        commander.refused = refusal(refuse(Reason.STOPPED, "stopped"))
        commander.state = replace(STATE, position=7.0)
        assert not await put(record, HOLDER, 60.0)
        assert values(record, "VAL", "DVAL") == [7.0, 7.0]
        commander.refused = None
        commander.state = replace(STATE, position=59.9)
        assert await put(record, HOLDER, 60.0, "DVAL")
        assert values(record, "VAL", "DVAL", "RBV") == [60.0, 60.0, 59.9]
        commander.state = replace(STATE, position=64.8)
        assert await put(record, HOLDER, 5.0, "RLV")
        assert values(record, "VAL", "DVAL") == [64.8, 64.8]

    with_record(act)


def test_setpoint_and_limits_count_from_the_users_zero() -> None:
    async def act(record: MotorRecord, _commander: Commander) -> None:
        await record.show(replace(STATE, position=10.0, in_motion=True))
        await record.show(replace(STATE, position=10.0, zero=4.0))
        assert values(record, "VAL", "DVAL", "RBV", "DRBV") == [6.0, 10.0, 6.0, 10.0]
        assert values(record, "LLM", "HLM", "DLLM", "DHLM") == [-104.0, 96.0, -100.0, 100.0]
        for name, low, high in (("VAL", -104.0, 96.0), ("RBV", -104.0, 96.0), ("DVAL", -100, 100)):
            shown = record.channels[f"R.{name}"]
            assert (shown.lower_ctrl_limit, shown.upper_ctrl_limit) == (low, high)

    with_record(act)


def test_an_alarm_ends_with_its_cause() -> None:
    async def act(record: MotorRecord, commander: Commander) -> None:
        commander.arrive.set()
        commander.refused = refusal(refuse(Reason.STOPPED, "motion is stopped"))
        assert not await put(record, HOLDER, 60.0)
        await record.forget("NO_LEASE")
        assert record.channels["R.RBV"].alarm.status == ca.ALARMS["STOPPED"][0]
        await record.forget("STOPPED")
        assert record.channels["R.RBV"].alarm.severity == 0
        assert values(record, "STAT", "SEVR") == [0, 0]
        assert record.channels["R:reason"].value == ""

    with_record(act)


def test_who_may_not_move_does_not_change_how_far_a_tweak_goes() -> None:
    async def act(record: MotorRecord, _commander: Commander) -> None:
        assert not await put(record, STRANGER, 50.0, "TWV")
        assert values(record, "TWV") == [1.0]
        assert await put(record, HOLDER, 3.0, "TWV")
        assert values(record, "TWV") == [3.0]
        assert await put(record, HOLDER, 1e6, "TWV"), "the gate refuses what goes too far"

    with_record(act)
