"""A stop of the platform brings the motors of the lens to rest as well."""

from collections.abc import Iterator

import pytest

import cosmic
from cosmic.frame.errors import MoveCancelled
from cosmic.vico.api.lens import LensHandle
from cosmic.vico.hw.peripherals import LensAxis
from unit.mico.rigs import wait_until


@pytest.fixture
def rig() -> Iterator[cosmic.Rig]:
    with cosmic.connect(None, ("mico", "vico"), rate=2.0) as rig:
        yield rig


def lens_of(rig: cosmic.Rig) -> LensHandle:
    lens = rig.vico.lens
    assert lens is not None
    return lens


def moving(lens: LensHandle) -> bool:
    return any((state := lens.state(axis)) is not None and state.moving for axis in LensAxis)


@pytest.mark.parametrize("search", [False, True], ids=["homing", "autofocus"])
def test_a_lens_that_moves_is_stopped_with_the_axes(rig: cosmic.Rig, search: bool) -> None:
    lens = lens_of(rig)
    if search:
        lens.home().wait(60.0)
    task = lens.autofocus() if search else lens.home()
    wait_until(lambda: moving(lens))
    rig.stop("enough")
    with pytest.raises(MoveCancelled):
        task.wait(10.0)
    wait_until(lambda: not moving(lens))
    rig.reset_stop()
    assert not moving(lens)


def test_a_lens_can_be_moved_while_axes_are_stopped(rig: cosmic.Rig) -> None:
    rig.stop("the plate is changed")
    lens_of(rig).home().wait(60.0)
    assert lens_of(rig).zoom is not None
