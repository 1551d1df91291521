"""The force limit of a campaign is armed from when the probe leaves its parking place."""

from types import SimpleNamespace
from typing import Any

import pytest

from cosmic.autonomy.handling.force_limit import armed_beyond_parking, guard_probe
from cosmic.autonomy.handling.prepare import beside_jaws, retract_probe
from cosmic.autonomy.handling.push import PushSpans
from cosmic.daqco.core.settings import LimitSettings
from cosmic.frame.errors import DeviceError, NotAvailable
from unit.autonomy.handling.test_push import Bench, carried_out

MINE = LimitSettings(channel="force", low=-150.0, high=150.0, hysteresis=5.0, armed=True)


def platform() -> Bench:
    """Return a platform whose operator has armed the limit of the probe."""
    bench = Bench(5e-11)
    bench.at_um["probe.y"] = 1000.0
    daqco: Any = bench.daqco
    daqco.set_limit(MINE)
    return bench


def limit(bench: Bench) -> LimitSettings:
    daqco: Any = bench.daqco
    settings = daqco.limits[0].settings
    assert isinstance(settings, LimitSettings)
    return settings


def test_it_is_armed_while_the_probe_is_out_and_the_operator_s_comes_back() -> None:
    bench = platform()
    with armed_beyond_parking(bench):
        assert not limit(bench).armed, "parked: a board that fails is begun again"
        carried_out(beside_jaws(bench))
        assert limit(bench).armed
        assert limit(bench).high == bench.settings.push.stop_un
        carried_out(retract_probe(bench))
        assert not limit(bench).armed
    assert limit(bench) == MINE


def test_it_stays_armed_where_the_probe_cannot_be_parked() -> None:
    bench = platform()
    ended = DeviceError("probe.y has not come on")
    with armed_beyond_parking(bench):
        carried_out(beside_jaws(bench))

        def refuse(*_targets: object) -> None:
            raise ended

        bench.go = refuse  # type: ignore[assignment, method-assign]
        with pytest.raises(DeviceError):
            carried_out(retract_probe(bench))
        assert limit(bench).armed


def test_the_probe_does_not_leave_where_the_limit_cannot_be_armed() -> None:
    bench = platform()
    at = dict(bench.at_um)
    with armed_beyond_parking(bench):
        daqco: Any = bench.daqco

        def dead(_limit: object) -> None:
            raise NotAvailable("nothing is acquired")

        daqco.set_limit, set_limit = dead, daqco.set_limit
        with pytest.raises(NotAvailable):
            carried_out(beside_jaws(bench))
        daqco.set_limit = set_limit
    assert bench.at_um["probe.y"] == at["probe.y"]


def test_what_the_operator_armed_or_not_stands_outside_of_a_campaign() -> None:
    bench = platform()
    guard_probe(bench)
    assert limit(bench) == MINE
    off = SimpleNamespace(settings=MINE.model_copy(update={"armed": False}))
    daqco: Any = bench.daqco
    daqco.limits = [off]
    with armed_beyond_parking(bench):
        guard_probe(bench)
        assert not limit(bench).armed


def test_after_a_push_the_probe_is_parked_and_what_fails_then_stops_nothing() -> None:
    bench = platform()
    with armed_beyond_parking(bench):
        carried_out(PushSpans().run(bench))
        away = bench.settings.places.probe_away_y_um
        assert bench.tip_now(bench.probe)[1] == pytest.approx(away, abs=1.0)
        assert not limit(bench).armed
    assert limit(bench) == MINE
