"""Every kind of process keeps garbage collection from its movements while its platform is open."""

import gc
from argparse import Namespace
from pathlib import Path

import pytest

import cosmic
from cosmic.app.commands import campaign as campaign_command
from cosmic.app.commands import serve as serving
from cosmic.app.commands.serve import ServeOptions
from cosmic.app.rig import Rig
from cosmic.frame.garbage import GARBAGE, NEVER
from unit.mico.rigs import wait_until

USUAL = gc.get_threshold()


class Seen(Exception):  # noqa: N818 - it tells of no error
    """What was wanted has been looked at."""


def assert_in_force() -> None:
    assert GARBAGE.in_force
    assert gc.get_threshold() == (*USUAL[:2], NEVER)
    assert gc.get_freeze_count() > 10_000
    assert gc.isenabled()


def assert_put_back() -> None:
    assert not GARBAGE.in_force
    assert gc.get_threshold() == USUAL
    assert gc.get_freeze_count() == 0
    assert gc.isenabled()


def test_a_script_has_it_until_its_last_platform_is_closed() -> None:
    assert_put_back()
    with cosmic.connect(applications=("mico",)):
        with cosmic.connect(applications=("daqco",)):
            assert_in_force()
        assert_in_force()
    assert_put_back()


def test_it_asks_the_platform_whether_anything_moves() -> None:
    with cosmic.connect(applications=("mico",)) as rig:
        moves = rig._platform.garbage.moves
        assert not moves()
        move = rig.mico["left.x"].move_by(500.0, wait=False)
        wait_until(moves)
        move.cancel()
        wait_until(lambda: not moves())


def test_a_campaign_without_a_window_has_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def campaign(_rig: Rig, _recipe: object, _folder: object) -> None:
        assert_in_force()
        raise Seen

    monkeypatch.setattr(Rig, "campaign", campaign)
    monkeypatch.setattr(campaign_command, "gui_application", lambda: None)
    unset = dict.fromkeys(
        ("rate", "seed", "sample", "config", "truth", "connect", "certificates", "world")
    )
    with pytest.raises(Seen):
        campaign_command.run(
            Namespace(recipe=Path("quick"), out=tmp_path / "out", cold=False, **unset)
        )
    assert_put_back()


def test_a_station_has_it(monkeypatch: pytest.MonkeyPatch) -> None:
    def host(*_given: object, **_named: object) -> None:
        assert_in_force()
        raise Seen

    monkeypatch.setattr(serving, "StationHost", host)
    with pytest.raises(Seen):
        serving.serve(ServeOptions(applications=("mico",)))
    assert_put_back()
