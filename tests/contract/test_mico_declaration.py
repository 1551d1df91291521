"""Every command and every state that MiCo declares, from one table, here and through a station."""

from collections.abc import Callable, Iterator
from itertools import count
from typing import Any

import pytest

from contract.mico_rig import HostedMico, hosted_mico, remote_mico, wait_for
from cosmic.frame.declaration import Declared, declaration_of
from cosmic.frame.errors import CosmicError
from cosmic.frame.operation import Operation
from cosmic.mico.api.mico import Mico
from cosmic.mico.api.planned_path import PlannedPath
from cosmic.mico.core.motion.orders import Jog, MoveBy, MoveTo

TEXT = "cosmic-trajectory 1\nplatform FiberStation\nleft.x to 20 um\n"
KEYS = count()
ROUND_TRIP = PlannedPath(
    {"left.x": 0.0}, ({"left.x": 30.0}, {"left.x": 10.0}), "straight", 40.0, 40.0, 1.0
)


def moved(mico: Mico) -> float:
    return round(mico["left.x"].position_um or 0.0, -1)


def first_moved(mico: Mico, then: Callable[[Mico], object]) -> object:
    mico["left.x"].move_to(20.0)
    return then(mico)


def linked(mico: Mico, *, taken_away: bool) -> object:
    mico.add_link("left.x", "right.x", 1.0)
    if taken_away:
        mico.remove_links("left.x")
    return dict(mico["left.x"].linked_to)


def jogged(mico: Mico, key: str) -> object:
    axis = mico["left.x"]
    movement = axis.begin_jog(Jog(1, 50.0), key)
    for _ in range(3):
        axis.renew(key)
    axis.halt("enough")
    return type(movement.exception(10.0)).__name__


def taught(mico: Mico, then: Callable[[Mico], object]) -> object:
    mico.poses.learn("here", ["left.x"])
    mico["left.x"].move_to(20.0)
    found = then(mico)
    mico.poses.remove("here")
    return found, mico.poses.names


def given(mico: Mico) -> str:
    key = str(next(KEYS))
    mico.trajectories.give(key, TEXT[:30])
    mico.trajectories.give(key, TEXT[30:])
    return key


def player(mico: Mico) -> Any:
    number = mico.trajectories.begin_player(given(mico))
    return mico.trajectories.players[number]


def watched(mico: Mico, *, on: bool) -> object:
    mico["left.x"].watch(False)
    if on:
        mico["left.x"].watch(True)
    found = mico.taken_out
    mico["left.x"].watch(True)
    return found


def allowed(mico: Mico) -> object:
    mico.set_contact("grasp", allowed=True)
    found = mico.allowed_contacts
    mico.set_contact("grasp", allowed=False)
    return found, mico.allowed_contacts


def speed_and_loops(mico: Mico) -> object:
    made = player(mico)
    made.go_at(2.0)
    made.repeat(3)
    return made.speed, made.loops


def told_to(mico: Mico, what: str) -> object:
    made = player(mico)
    getattr(made, what)()
    return str(made.state)


def stopped(mico: Mico) -> object:
    mico.stop("table")
    return "table" in (mico.stop_state.reason or "")


def reset(mico: Mico) -> object:
    mico.stop("table")
    mico.reset_stop()
    return mico.stop_state.reason


def place(mico: Mico) -> object:
    mico["left.gripper"].place_at(300.0, 4.0)
    return mico["left.gripper"].position_um


def zero(mico: Mico) -> object:
    mico["left.x"].show_from(100.0)
    return moved(mico)


def frequency(mico: Mico) -> object:
    mico["left.x"].limit_frequency(700)
    return mico["left.x"].closed_loop_frequency_hz


COMMANDS: dict[str, Callable[[Mico], object]] = {
    "begin_together": lambda mico: mico.begin_together({"left.x": MoveTo(30.0, "um")}),
    "check_motions": lambda mico: mico.check_motions({"left.x": MoveTo(9e4, "um")}).reason,
    "stop": stopped,
    "reset_stop": reset,
    "begin_initialisation": lambda mico: mico.begin_initialisation(skip_known=True, may_hold=True),
    "answer": lambda mico: mico.answer(True),
    "begin_rescan": lambda mico: mico.begin_rescan(),
    "begin_search": lambda mico: mico.begin_search({"left.x": 30.0}, 1.0),
    "begin_detour": lambda mico: mico.begin_detour(ROUND_TRIP),
    "add_link": lambda mico: linked(mico, taken_away=False),
    "remove_links": lambda mico: linked(mico, taken_away=True),
    "begin_undo": lambda mico: first_moved(
        mico, lambda mico: mico.begin_undo(mico.undo_entries[0].number)
    ),
    "nearest": lambda mico: mico.nearest(mico.positions() or {}),
    "scene": lambda mico: sorted(mico.scene().bodies),
    "set_contact": allowed,
    "axes.begin": lambda mico: mico["left.x"].begin(MoveBy(30.0, "um")),
    "axes.begin_jog": lambda mico: jogged(mico, "begin"),
    "axes.renew": lambda mico: jogged(mico, "renew"),
    "axes.halt": lambda mico: mico["left.x"].halt("table"),
    "axes.show_from": zero,
    "axes.place_at": place,
    "axes.limit_frequency": frequency,
    "axes.check_motion": lambda mico: mico["left.x"].check_motion(MoveTo(9e4, "um")).reason,
    "axes.watch": lambda mico: (watched(mico, on=False), watched(mico, on=True)),
    "poses.learn": lambda mico: taught(mico, lambda mico: mico.poses.names),
    "poses.remove": lambda mico: taught(mico, lambda _: None),
    "poses.begin": lambda mico: taught(mico, lambda mico: mico.poses.begin("here").wait(10.0)),
    "trajectories.give": lambda mico: bool(given(mico)),
    "trajectories.begin_rehearsal": lambda mico: (
        mico.trajectories.begin_rehearsal(given(mico)).wait(20.0).end
    ),
    "trajectories.begin_player": lambda mico: player(mico).trajectory.lines,
    "trajectories.players.text": lambda mico: player(mico).text(),
    "trajectories.players.go_at": speed_and_loops,
    "trajectories.players.repeat": speed_and_loops,
    "trajectories.players.pause": lambda mico: told_to(mico, "pause"),
    "trajectories.players.cancel": lambda mico: told_to(mico, "cancel"),
    "trajectories.players.begin": lambda mico: player(mico).begin("straight"),
}
"""What is done with each command; the outcome has to be the same wherever it is done."""
RESCAN = "begin_rescan"


def declared(kind: type[Declared], of: str, prefix: str = "") -> Iterator[str]:
    """Yield the names of all commands, or all state, of a class and its parts."""
    declaration = declaration_of(kind)
    for name in getattr(declaration, of):
        yield f"{prefix}{name}"
    for name, part in declaration.parts.items():
        yield from declared(part.kind, of, f"{prefix}{name}.")


@pytest.fixture(scope="module")
def station() -> Iterator[HostedMico]:
    with hosted_mico() as made:
        yield made


def test_the_table_names_every_command() -> None:
    assert set(COMMANDS) == set(declared(Mico, "commands"))


@pytest.mark.parametrize("name", [name for name in COMMANDS if name != RESCAN])
def test_a_command_does_the_same_wherever_it_is_given(station: HostedMico, name: str) -> None:
    here, there = both(station, COMMANDS[name])
    assert type(here) is type(there) if name == "nearest" else here == there


def test_a_rescan_does_the_same_wherever_it_is_given() -> None:
    with hosted_mico() as station:  # one of its own: it makes the devices anew
        here, there = both(station, COMMANDS[RESCAN])
        assert here == there


def both(station: HostedMico, action: Callable[[Mico], object]) -> tuple[object, object]:
    """Return what comes of an action at the station itself, and from another program."""
    station.begin_anew()
    here = outcome(action, station.mico)
    station.begin_anew()
    with remote_mico(station, "memory") as (mico, _, _):
        return here, outcome(action, mico)


def outcome(action: Callable[[Mico], object], mico: Mico) -> object:
    """Return what comes of an action: its result, and where the axis is afterwards."""
    found = action(mico)
    if isinstance(found, Operation):
        error = found.exception(30.0)
        assert error is None or isinstance(error, CosmicError)
        result = found.result if error is None else None
        rounded = (
            {name: round(at, -1) for name, at in result.items()}
            if isinstance(result, dict)
            else type(result).__name__
        )
        return type(found).__name__, rounded, type(error).__name__, moved(mico)
    return found


def values(thing: Declared, kind: type[Declared]) -> dict[str, object]:
    """Return the state of an object and of its parts, as anybody reads it."""
    declaration = declaration_of(kind)
    found: dict[str, object] = {name: getattr(thing, name) for name in declaration.state}
    for name, part in declaration.parts.items():
        inner = getattr(thing, name)
        for key, one in inner.items() if part.keyed else [("", inner)]:
            under = f"{name}.{key}." if key else f"{name}."
            found |= {f"{under}{of}": value for of, value in values(one, part.kind).items()}
    return found


def test_every_state_is_the_same_wherever_it_is_read(station: HostedMico) -> None:
    station.begin_anew()
    station.mico["left.x"].move_to(10.0)
    station.mico.poses.learn("somewhere", ["left.x"])
    station.mico.trajectories.prepare(station.mico.trajectories.parse(TEXT))
    with remote_mico(station, "memory", takes_lease=False) as (mico, _, _):
        wait_for(lambda: mico["left.x"].details.position == station.mico["left.x"].details.position)
        wait_for(lambda: values(mico, Mico).keys() == values(station.mico, Mico).keys())
        here, there = values(station.mico, Mico), values(mico, Mico)
    assert {name for name in here if here[name] != there[name]} == set()
    last = {name.rpartition(".")[2] for name in here}
    assert {name.rpartition(".")[2] for name in declared(Mico, "state")} <= last
