"""Jaws without a sensor: brought in step with what is counted, whatever a step is worth."""

from contextlib import nullcontext
from types import SimpleNamespace
from typing import Any

import pytest

from cosmic.autonomy.handling.jaws import in_step, move_jaws, zero_jaws
from cosmic.autonomy.handling.settings import HandlingSettings
from cosmic.autonomy.procedures.operation import Steps


class Moved:
    """Steps that have been made."""

    done = True

    def wait(self, timeout_s: float | None = None) -> None:
        """Nothing to wait for."""

    def exception(self, timeout: float | None = 0.0) -> None:
        """It went well."""

    def cancel(self) -> None:
        """It has ended."""


class Gripper:
    """Jaws between two stops; a step that closes is worth less than one that opens."""

    def __init__(self, gap_um: float, counted_um: float) -> None:
        self.gap_um, self.position_um = gap_um, counted_um
        self.widest_um = gap_um

    def steps(self, steps: int, *, frequency_hz: float, wait: bool) -> Moved:
        self.position_um += steps
        self.gap_um = min(max(self.gap_um + steps * (1.0 if steps > 0 else 0.95), 0.0), 1000.0)
        self.widest_um = 0.0 if self.gap_um == 0.0 else max(self.widest_um, self.gap_um)
        return Moved()

    def set_estimate(self, position: float, *, std_um: float | None) -> None:
        self.position_um = position


def bench(gripper: Gripper) -> Any:
    mico: Any = {"left.gripper": gripper}
    positioner = SimpleNamespace(name="left.gripper", step_um=1.0)

    class Mico(dict[str, Gripper]):
        settings = SimpleNamespace(positioner=[positioner])
        collision = SimpleNamespace(contact=lambda _: nullcontext())

    return SimpleNamespace(
        mico=Mico(mico),
        settings=HandlingSettings(),
        gripper=SimpleNamespace(gap_axis="left.gripper"),
        gap_um=None,
    )


def made(steps: Steps) -> None:
    for _ in steps:
        pass


@pytest.mark.parametrize(("gap_um", "counted_um"), [(600.0, 600.0), (0.0, -5000.0), (30.0, 900.0)])
def test_jaws_found_anyhow_end_as_wide_as_for_a_grasp_and_in_step(gap_um: float, counted_um: float):
    gripper = Gripper(gap_um, counted_um)
    work = bench(gripper)
    made(zero_jaws(work))
    assert gripper.gap_um == work.gap_um == work.settings.grasp.gap_um
    assert gripper.widest_um == gripper.gap_um, "no wider since they were closed"
    assert in_step(work)


def test_many_grasps_keep_the_opening_known_though_the_count_wanders_off():
    gripper = Gripper(600.0, 600.0)
    work = bench(gripper)
    made(zero_jaws(work))
    for _ in range(20):
        made(move_jaws(work, -(work.gap_um + work.settings.grasp.closing_um)))
        assert gripper.gap_um == 0.0
        made(move_jaws(work, work.settings.grasp.gap_um))
        assert gripper.gap_um == work.gap_um
    assert not in_step(work)
    made(zero_jaws(work))
    assert in_step(work)
