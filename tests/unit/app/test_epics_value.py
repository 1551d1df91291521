"""A measured value as a record: its alarms are those of the limit in force, and of its age."""

import asyncio
from collections.abc import Awaitable, Callable
from math import isnan
from typing import Any

import numpy as np
import pytest

from cosmic.app.gateways import epics_channels as ca
from cosmic.app.gateways.epics_motor import FRESH_S, ValueRecord
from cosmic.daqco.core.limits import Limit

QUIET = np.array([1.0, 2.0, 3.0])
PEAK = np.array([1.0, 200.0, 3.0])
DIP = np.array([1.0, -200.0, 3.0])
ARMED = Limit("force", -150.0, 150.0, armed=True)


def with_record(act: Callable[[ValueRecord], Awaitable[None]]) -> None:
    asyncio.run(act(ValueRecord("F", "V")))


def alarm(record: ValueRecord) -> Any:
    shown, fields = record.channels["F"].alarm, record.channels
    assert fields["F.STAT"].value == int(shown.status)
    assert fields["F.SEVR"].value == int(shown.severity)
    return shown.status, shown.severity


@pytest.mark.parametrize(
    ("samples", "limit", "expected"),
    [
        (QUIET, ARMED, ca.NO_ALARM),
        (PEAK, ARMED, ca.TOO_HIGH),
        (DIP, ARMED, ca.TOO_LOW),
        (PEAK, None, ca.NO_ALARM),
        (PEAK, Limit("force", -150.0, 150.0), ca.NO_ALARM),
        (QUIET, Limit("force", -150.0, 150.0, armed=True, tripped=True), ca.FAULT),
        (np.array([np.nan, 1.0]), ARMED, ca.UNKNOWN),
    ],
    ids=["inside", "a peak", "a dip", "no limit", "disarmed", "not acknowledged", "no number"],
)
def test_one_sample_beyond_the_limit_in_force_is_an_alarm(
    samples: Any, limit: Limit | None, expected: Any
) -> None:
    async def act(record: ValueRecord) -> None:
        await record.show(samples, "uN", limit, 10.0)
        assert alarm(record) == expected

    with_record(act)


def test_alarm_limits_are_those_in_force_and_none_where_there_are_none() -> None:
    async def act(record: ValueRecord) -> None:
        fields = record.channels
        await record.show(QUIET, "uN", Limit("force", high=150.0, armed=True), 10.0)
        assert fields["F"].upper_alarm_limit == fields["F.HIHI"].value == 150.0
        assert isnan(fields["F"].lower_alarm_limit)
        assert isnan(fields["F.LOLO"].value)
        await record.show(QUIET, "uN", None, 10.1)
        assert isnan(fields["F"].upper_alarm_limit)
        assert isnan(fields["F.HIHI"].value)

    with_record(act)


def test_a_value_that_no_sample_follows_is_not_that_of_now() -> None:
    async def act(record: ValueRecord) -> None:
        await record.look(0.0)
        assert alarm(record) == ca.UNKNOWN, "none has come yet"
        await record.show(QUIET, "uN", ARMED, 10.0)
        await record.look(10.0 + FRESH_S)
        assert alarm(record) == ca.NO_ALARM
        await record.look(10.1 + FRESH_S)
        assert alarm(record) == ca.UNKNOWN
        assert record.channels["F:wave"].alarm.status == ca.UNKNOWN[0]
        assert record.channels["F"].value == 2.0
        await record.show(QUIET, "uN", ARMED, 20.0)
        assert alarm(record) == ca.NO_ALARM

    with_record(act)


def test_the_newest_samples_are_shown_however_many_come_at_once() -> None:
    async def act(record: ValueRecord) -> None:
        await record.show(np.arange(24_000.0), "uN", None, 0.0)
        wave = record.channels["F:wave"].value
        assert (len(wave), wave[-1]) == (20_000, 23_999.0)
        assert record.channels["F"].value == pytest.approx(11_999.5)

    with_record(act)
