"""No fibre is taken, and no limit armed, before the force can be measured."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, cast

import pytest

from cosmic.autonomy.handling.context import Calibration, SharedWorkspace
from cosmic.autonomy.handling.force import ForceMean
from cosmic.autonomy.handling.push import APART_S, LOOKS, SeeForce
from cosmic.autonomy.handling.settings import HandlingSettings
from cosmic.autonomy.procedures.operation import SAFE_POINT, OperationFailed
from cosmic.frame.errors import DeviceError, NotAvailable


class Daqco:
    """Acquisition that can end, and be refused for a while."""

    def __init__(self) -> None:
        self.running = True
        self.starts = 0
        self.refusals = 0

    def start(self) -> None:
        self.starts += 1
        if self.refusals:
            self.refusals -= 1
            raise DeviceError("the board is gone")
        self.running = True


class Work:
    """As much of the work as looking at the force needs; what is felt comes from a list."""

    def __init__(self, *felt: float | ForceMean | Exception) -> None:
        self.settings = HandlingSettings()
        self.calibration = Calibration()
        self.daqco = Daqco()
        self.forces = self
        self.shared = SharedWorkspace()
        self.failures: list[tuple[str, OperationFailed]] = []
        self.felt = list(felt)
        self.probe_y_um = 1000.0
        self.waited_s = 0.0

    def wanted(self, _seconds: float, *, settle_s: float = 0.0) -> Callable[[], ForceMean]:
        def mean() -> ForceMean:
            found = self.felt.pop(0) if len(self.felt) > 1 else self.felt[0]
            if isinstance(found, Exception):
                raise found
            if isinstance(found, ForceMean):
                return found
            return ForceMean(found, 0.1, 0.0, 20)

        return mean

    probe = SimpleNamespace(y_axis="probe.y", tip_um=(0.0, 0.0, 0.0))

    def tip_now(self, _tool: object) -> tuple[float, float]:
        return 0.0, self.probe_y_um

    def go(self, targets: dict[str, float]) -> Callable[[], None]:
        def gone() -> None:
            self.probe_y_um = targets["probe.y"]

        return gone


def carry_out(work: Work) -> None:
    steps = SeeForce().run(cast("Any", work))
    wish: Any = next(steps)
    while wish is not SAFE_POINT:
        if isinstance(wish, float):
            work.waited_s += wish
            wish = next(steps)
            continue
        try:
            value = wish()
        except NotAvailable as exc:
            wish = steps.throw(exc)
        else:
            wish = steps.send(value)


def test_a_sensor_near_zero_is_looked_at_once():
    work = Work(1.5)
    carry_out(work)
    assert (work.waited_s, work.probe_y_um) == (0.0, 1000.0)


def test_from_a_sensor_at_its_end_the_probe_is_taken_away_and_it_may_come_back():
    work = Work(179.0, 179.0, -2.0)
    carry_out(work)
    assert work.waited_s == pytest.approx(2.0 * APART_S)
    assert work.probe_y_um == work.settings.places.probe_away_y_um


@pytest.mark.parametrize("reading_un", [179.0, -179.0, float("nan")])
def test_one_that_stays_there_is_reported_with_what_to_look_at(reading_un: float):
    work = Work(reading_un)
    with pytest.raises(OperationFailed, match=r"reads .* uN with nothing at the probe.*cable"):
        carry_out(work)
    assert work.waited_s == pytest.approx((LOOKS - 1) * APART_S)
    assert work.failures[-1][1].cause == "force sensor"


def test_one_that_has_no_noise_is_reported_as_dead():
    work = Work(ForceMean(0.3, 0.002, 0.0, 20))
    with pytest.raises(OperationFailed, match=r"reads 0\.3 uN without any noise.*cable"):
        carry_out(work)
    assert work.waited_s == pytest.approx((LOOKS - 1) * APART_S)


def test_acquisition_that_has_ended_is_begun_again():
    work = Work(0.0)
    work.daqco.running, work.daqco.refusals = False, 2
    carry_out(work)
    assert work.daqco.starts == 3


def test_a_board_that_stays_away_is_reported():
    work = Work(NotAvailable("no samples of the force came: the board is gone"))
    with pytest.raises(OperationFailed, match="the board is gone"):
        carry_out(work)
