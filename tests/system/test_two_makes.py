"""SCUs and an MCS2 on one platform, behind one gate, in one movement."""

import runpy
from collections.abc import Iterator
from pathlib import Path

import pytest

import cosmic

ROOT = Path(__file__).parents[2]


@pytest.fixture
def rig(tmp_path: Path) -> Iterator[cosmic.Rig]:
    written = runpy.run_path(str(ROOT / "examples" / "two_makes.py"))["write_platform"](tmp_path)
    with cosmic.connect(written, applications=("mico",), rate=20.0) as opened:
        yield opened


def test_axes_of_both_makes_go_to_their_targets_in_one_movement(rig: cosmic.Rig) -> None:
    names = ["left.x", "probe.x", "table.rotation"]
    targets = {name: rig.mico[name].details.position - 20.0 for name in names}
    assert rig.mico.check(targets).allowed
    reached = rig.mico.move(targets, match_arrival=True)
    for name, target in targets.items():
        assert reached[name] == pytest.approx(target, abs=1.0)


def test_the_gate_stands_in_front_of_both_makes(rig: cosmic.Rig) -> None:
    before_um = rig.mico["probe.x"].position_um
    with pytest.raises(cosmic.LimitError, match=r"probe\.x"):
        rig.mico.move({"left.x": 10.0, "probe.x": 1e6})
    assert rig.mico["probe.x"].position_um == pytest.approx(before_um, abs=0.5)


def test_a_stop_reaches_both_makes_and_is_latched(rig: cosmic.Rig) -> None:
    left, probe = rig.mico["left.x"], rig.mico["probe.x"]
    moves = [each.move_to(each.position_um - 900.0, wait=False) for each in (left, probe)]
    rig.stop()
    for move in moves:
        assert isinstance(move.exception(10), cosmic.StoppedError)
    with pytest.raises(cosmic.StoppedError):
        probe.move_by(1.0)
    rig.reset_stop()
    assert probe.move_by(5.0) is not None


def test_a_controller_that_is_lost_takes_only_its_own_axes_along(rig: cosmic.Rig) -> None:
    rig.faults.inject("unplugged", device=2)
    with pytest.raises(cosmic.CosmicError):
        for _ in range(100):
            rig.mico["probe.x"].move_by(1.0)
    assert not rig.mico["probe.x"].details.present
    rig.reset_stop()
    assert rig.mico["left.x"].move_by(-5.0) is not None
