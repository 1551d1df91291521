"""What is declared once is used the same in this process and from another station."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PySide6.QtWidgets import QPushButton

from contract.cabinet import (
    Cabinet,
    Colour,
    Lamp,
    LampSettings,
    LampState,
    Sample,
    WithBell,
)
from contract.station_rig import connected, free_port, listening, wait_until
from cosmic.frame.declaration import (
    Companion,
    Declared,
    command,
    declaration_of,
    newest,
    part,
    stream,
)
from cosmic.frame.errors import ConfigError, MoveRefused, NotAvailable, WrongThreadError
from cosmic.frame.failure import Failure, FailurePolicy
from cosmic.frame.network.application import RemoteApplication
from cosmic.frame.network.caller import Access
from cosmic.frame.network.client_side_connection import ClientSideConnection
from cosmic.frame.network.errors import CallRefused, StationAway
from cosmic.frame.network.host import Host
from cosmic.frame.network.line_settings import Line
from cosmic.frame.network.station import Station
from cosmic.frame.network.transport import Rule
from cosmic.frame.operation import Progress
from cosmic.frame.threads import declare_gui_thread


@dataclass
class Rig:
    """`far` is what is tested: the cabinet itself, or a proxy of it."""

    home: Cabinet
    far: Cabinet
    station: Station | None = None
    transport: ClientSideConnection | None = None
    failures: list[Failure] | None = None


@contextmanager
def served(home: Cabinet, endpoint: str, policy: FailurePolicy) -> Iterator[Station]:
    station, host = Station("fibres", policy), Host("cabinet", home)
    station.host("cabinet", host)
    with ExitStack() as stack:
        stack.callback(host.close)
        line = Line(endpoint, listens=True, station="fibres")
        stack.enter_context(
            listening(station, line, lambda name: Access.VIEW if name == "viewer" else Access.MOVE)
        )
        yield station


@contextmanager
def used(endpoint: str, kind: type[Cabinet], name: str = "vision") -> Iterator[Any]:
    with connected(endpoint, name) as transport:
        remote = RemoteApplication("Cabinet", kind, transport, FailurePolicy(), name="cabinet")
        try:
            remote.initialize()
            yield remote
        finally:
            remote.shut_down()


@contextmanager
def cabinet_rig(where: str, kind: type[Cabinet] = Cabinet) -> Iterator[Rig]:
    home = kind()
    if where == "home":
        yield Rig(home, home, failures=[])
        return
    endpoint, policy = f"tcp/127.0.0.1:{free_port()}", FailurePolicy()
    failures: list[Failure] = []
    policy.subscribe(failures.append)
    with served(home, endpoint, policy) as station, used(endpoint, kind) as remote:
        yield Rig(home, remote.api, station, remote.transport, failures)


@pytest.fixture(params=["home", "station"])
def rig(request: pytest.FixtureRequest) -> Iterator[Rig]:
    with cabinet_rig(request.param) as made:
        yield made


@pytest.fixture
def remote() -> Iterator[Rig]:
    with cabinet_rig("station") as made:
        yield made


def take_control(rig: Rig) -> None:
    if rig.transport is not None:
        rig.transport.take_lease()


# --- the same at both places ------------------------------------------------------------------


def test_a_command_is_seen_in_the_next_line(rig: Rig) -> None:
    cabinet = rig.far
    assert isinstance(cabinet, Cabinet)
    assert cabinet.name == "lamp"
    cabinet.apply(LampSettings(name="other", brightest=2.0))
    assert cabinet.settings == LampSettings(name="other", brightest=2.0)
    cabinet.lamp.shine(Colour.GREEN, level=0.5)
    assert cabinet.lamp.shown == LampState(Colour.GREEN, 0.5)
    assert cabinet.where("run.h5") == (Path("/recordings/run.h5"), Colour.GREEN)
    assert cabinet.where(Path("a"), Colour.RED) == (Path("/recordings/a"), Colour.RED)


def test_a_part_with_a_key_is_commanded_and_shows_its_state(rig: Rig) -> None:
    assert list(rig.far.drawers) == ["top", "left.x"]
    take_control(rig)
    drawer = rig.far.drawers["left.x"]
    assert drawer.move(5.0) == 5.0
    assert drawer.position_um == 5.0
    assert drawer.nudge() == 6.0
    assert rig.home.drawers["left.x"].moved_um == [5.0, 6.0]
    assert rig.far.drawers["top"].position_um == 0.0


def test_what_is_refused_raises_the_same_and_changes_nothing(rig: Rig) -> None:
    with pytest.raises(ConfigError, match="too bright"):
        rig.far.apply(LampSettings(name="x", brightest=11.0))
    with pytest.raises(TypeError):
        rig.far.apply()  # type: ignore[call-arg]
    assert rig.far.name == "lamp"
    assert not rig.failures


def test_every_change_is_reported_where_it_happened(rig: Rig) -> None:
    received: list[str] = []
    end = rig.far.on_change(lambda: received.append("cabinet"))
    rig.far.lamp.on_change(lambda: received.append("lamp"))
    rig.home.lamp.shine(Colour.GREEN)
    assert wait_until(lambda: "lamp" in received)
    rig.home.apply(LampSettings(name="other"))
    assert wait_until(lambda: "cabinet" in received and rig.far.name == "other")
    end()


def test_a_stream_of_which_all_count_comes_whole_and_in_order(rig: Rig) -> None:
    got: list[Sample] = []
    end = rig.far.subscribe(got.append)
    first = 0

    def emit_and_look() -> bool:
        nonlocal first
        rig.home.emit(first, 4)
        first += 4
        return len(got) > 20

    assert wait_until(emit_and_look)
    end()
    assert [b.first - a.first for a, b in pairwise(got)] == [4] * (len(got) - 1)
    assert np.array_equal(got[0].values, np.arange(4.0))
    assert rig.far.missed == 0


def test_what_takes_long_reports_its_progress_and_its_end(rig: Rig) -> None:
    task = rig.far.export()
    steps: list[Progress] = []
    task.subscribe(steps.append)
    rig.home.tasks[0].report(0.5, "half")
    assert wait_until(lambda: any(each.text == "half" for each in steps))
    rig.home.tasks[0].fail(ConfigError("the disk is full"))
    with pytest.raises(ConfigError, match="the disk is full"):
        task.wait(5.0)
    assert task.done


def test_what_an_operation_has_changed_is_known_when_it_ends(rig: Rig) -> None:
    for number in range(20):
        rig.far.rename(f"lamp{number}").wait(5.0)
        assert rig.far.name == f"lamp{number}"


# --- a command is added in one place ----------------------------------------------------------


@pytest.mark.parametrize("where", ["home", "station"])
def test_a_new_command_is_called_by_a_script_and_a_window_at_once(where: str, qtbot: Any) -> None:
    with cabinet_rig(where, WithBell) as rig:
        cabinet, home = rig.far, rig.home
        assert isinstance(cabinet, WithBell)
        assert isinstance(home, WithBell)
        assert cabinet.ring(2) == "ding ding "
        button, answers = QPushButton("Ring"), []
        qtbot.addWidget(button)
        button.clicked.connect(
            lambda: cabinet.carry_out(cabinet.ring, lambda *how: answers.append(how))
        )
        take_back = declare_gui_thread()
        try:
            button.click()
            assert wait_until(lambda: bool(answers))
        finally:
            take_back()
        assert answers == [("ding ", None)]
        assert home.rung == [2, 1]


# --- what only a line has ---------------------------------------------------------------------


def test_what_moves_needs_the_lease_and_dies_with_who_gave_it(remote: Rig) -> None:
    drawer = remote.far.drawers["top"]
    with pytest.raises(MoveRefused):
        drawer.move(1.0)
    take_control(remote)
    drawer.move(1.0)
    task = remote.far.travel()
    dead_man = remote.home.drawers["top"].dead_men[0]
    assert not dead_man.expired
    assert remote.transport is not None
    remote.transport.release_lease()
    assert wait_until(lambda: dead_man.expired)
    with pytest.raises(NotAvailable, match="halted"):
        task.wait(5.0)


def test_a_window_is_never_kept_waiting(remote: Rig) -> None:
    take_back = declare_gui_thread()
    try:
        with pytest.raises(WrongThreadError):
            remote.far.apply(LampSettings(name="x"))
        assert remote.far.name == "lamp", "state is read without waiting"
        remote.far.stop()  # overtakes everything
        with pytest.raises(NotAvailable, match="asked"):
            remote.far.free_bytes(Path("four"))

        def known() -> bool:
            try:
                return remote.far.free_bytes(Path("four")) == 40
            except NotAvailable:
                return False

        assert wait_until(known)
    finally:
        take_back()
    assert wait_until(lambda: remote.home.stops == 1)
    assert remote.far.free_bytes(Path("four")) == 40
    assert remote.home.asked == 1


BAD_CALLS: list[tuple[str, dict[str, Any]]] = [
    ("apply", {"settings": {"name": "x"}}),
    ("apply", {}),
    ("lamp.shine", {"colour": "green"}),
    ("drawers.move", {"target_um": 1.0}),
    ("drawers.move", {"target_um": 1.0, "@": ("none",)}),
    ("drawers.move", {"target_um": "1", "@": ("top",)}),
    ("emit", {"first": 0, "count": 1}),
    ("drawers.nudge", {"@": ("top",)}),
    ("note_change", {}),
]


def test_what_is_not_declared_or_makes_no_sense_is_refused(remote: Rig) -> None:
    assert remote.transport is not None
    take_control(remote)
    for function, arguments in BAD_CALLS:
        with pytest.raises(CallRefused):
            remote.transport.call("cabinet", function, arguments)
    assert remote.home.drawers["top"].moved_um == []
    assert not remote.failures


def test_who_may_only_look_reads_state_and_may_stop_but_not_command() -> None:
    endpoint, home = f"tcp/127.0.0.1:{free_port()}", Cabinet()
    with served(home, endpoint, FailurePolicy()), used(endpoint, Cabinet, "viewer") as viewer:
        assert viewer.api.name == "lamp"
        viewer.api.stop()
        with pytest.raises(CallRefused):
            viewer.api.apply(LampSettings(name="x"))
        with pytest.raises(CallRefused):
            viewer.api.drawers["top"].move(1.0)
    assert home.stops == 1


def test_the_newest_of_a_stream_comes_by_itself(remote: Rig) -> None:
    def emit_and_look() -> bool:
        remote.home.emit(7, 3)
        found = remote.far.latest
        return found is not None and found.first == 7

    assert wait_until(emit_and_look)


def test_what_was_lost_on_the_way_is_counted(remote: Rig, caplog: pytest.LogCaptureFixture) -> None:
    got: list[Sample] = []
    remote.far.subscribe(got.append)

    def emit_and_look() -> bool:
        remote.home.emit(0, 10)
        return bool(got)

    assert wait_until(emit_and_look)
    got.clear()
    remote.home.emit(37, 10)
    assert wait_until(lambda: any(each.first == 37 for each in got))
    assert remote.far.missed == 27
    assert "27 were lost" in caplog.text


def test_a_part_that_appears_or_goes_is_known(remote: Rig) -> None:
    home = remote.home
    home.put_in("new")
    assert wait_until(lambda: "new" in remote.far.drawers)
    take_control(remote)
    assert remote.far.drawers["new"].move(2.0) == 2.0
    home.take_out("new")
    assert wait_until(lambda: "new" not in remote.far.drawers)


def test_a_part_may_be_missing(rig: Rig) -> None:
    assert rig.far.spare is None
    rig.home.fit(Lamp())
    assert wait_until(lambda: rig.far.spare is not None)
    assert rig.far.spare is not None
    rig.far.spare.shine(Colour.GREEN)
    assert rig.far.spare.shown.colour is Colour.GREEN
    rig.home.fit(None)
    assert wait_until(lambda: rig.far.spare is None)
    if rig.transport is not None:
        with pytest.raises(CallRefused, match="no spare"):
            rig.transport.call("cabinet", "spare.shine", {"colour": Colour.RED})


def test_a_window_begins_what_takes_long_without_waiting(remote: Rig) -> None:
    take_back = declare_gui_thread()
    try:
        task, refused = remote.far.export(), remote.far.travel()
        assert wait_until(lambda: bool(remote.home.tasks))
        remote.home.tasks[0].report(0.5, "half")
        assert wait_until(lambda: task.progress.text == "half")
        task.cancel()
        assert wait_until(lambda: remote.home.tasks[0].cancel_requested)
        remote.home.tasks[0].finish()
        assert wait_until(lambda: task.done and refused.done)
    finally:
        take_back()
    task.wait(0.0)
    with pytest.raises(MoveRefused):
        refused.wait(0.0)


def test_a_window_has_done_aside_what_it_does_not_wait_for(remote: Rig) -> None:
    take_back = declare_gui_thread()
    try:
        remote.far.lock(1)
        assert wait_until(lambda: remote.far.refused == "that is not the code")
        remote.far.lock(7)
        assert wait_until(lambda: remote.home.locked)
        assert remote.far.refused == ""
    finally:
        take_back()
    with pytest.raises(ConfigError):
        remote.far.lock(2)
    assert remote.home.refused == ""


def test_nothing_is_made_for_a_stream_that_nobody_receives(
    remote: Rig, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("cosmic.frame.network.remote_stream.LINGER_S", 0.1)
    assert remote.station is not None
    wanted = remote.station.wanted
    for first in range(20):
        remote.home.emit(first, 1)
    assert remote.home.drawn == 0
    got: list[Sample] = []
    end = remote.far.watch(got.append)

    def emit_and_look() -> bool:
        remote.home.emit(7, 3)
        return bool(got)

    assert wait_until(emit_and_look)
    assert got[-1].first == 7
    end()
    assert wait_until(lambda: not wanted("cabinet/drawn"))
    before = remote.home.drawn
    remote.home.emit(8, 1)
    assert remote.home.drawn == before


def test_a_station_that_goes_says_so_and_goes_on_by_itself_when_it_is_back() -> None:
    endpoint, home = f"tcp/127.0.0.1:{free_port()}", Cabinet()
    with ExitStack() as stack:
        there = stack.enter_context(ExitStack())
        there.enter_context(served(home, endpoint, FailurePolicy()))
        far = stack.enter_context(used(endpoint, Cabinet)).api
        there.close()
        assert wait_until(lambda: "away" in far.away)
        assert far.name == "lamp", "what was known is still shown"
        with pytest.raises(StationAway):
            far.apply(LampSettings(name="x"))
        home.apply(LampSettings(name="meanwhile"))
        there.enter_context(served(home, endpoint, FailurePolicy()))
        assert wait_until(lambda: not far.away and far.name == "meanwhile")


class Watched(Cabinet):
    """A cabinet that is watched from where it is used."""

    class Watch(Companion):
        def __init__(self) -> None:
            self.states: list[bool] = []
            self.given: list[tuple[str, dict[str, object]]] = []
            self.longest_s = 0.0

        def on_state(self, *, first: bool) -> None:
            self.states.append(first)

        def on_commanded(self, command: str, arguments: Mapping[str, object]) -> None:
            self.given.append((command, dict(arguments)))

        def look(self, silent_s: float) -> None:
            self.longest_s = silent_s

    def made_companion(self) -> Companion:
        self.watch = self.Watch()
        return self.watch


def test_a_companion_hears_of_states_commands_and_silence_where_it_is_used() -> None:
    with cabinet_rig("station", Watched) as rig:
        assert isinstance(rig.far, Watched)
        watch = rig.far.watch
        settings = LampSettings(name="other")
        rig.far.apply(settings)
        assert watch.given == [("apply", {"settings": settings})]
        assert watch.states[0] is True
        assert not any(watch.states[1:])
        assert wait_until(lambda: 0.0 < watch.longest_s < 1.0)


# --- mistakes in a declaration ----------------------------------------------------------------


def test_a_declaration_that_cannot_be_checked_is_a_mistake_of_the_program() -> None:
    class NoKind(Declared):
        @command
        def go(self, how) -> None:  # type: ignore[no-untyped-def]
            ...

    class NoStream(Declared):
        @stream(Rule.ALL)
        def go(self, how: int) -> Callable[[], None]:
            return lambda: None

    class NoPart(Declared):
        @property
        @part
        def go(self) -> int:
            return 0

    class NoNewest(Declared):
        @property
        @newest("nothing")
        def go(self) -> int | None:
            return None

    for wrong in (NoKind, NoStream, NoPart, NoNewest):
        with pytest.raises(TypeError):
            declaration_of(wrong)
