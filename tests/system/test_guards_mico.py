"""What may change under the guards of MiCo while something moves: a test for each row.

The rows stand in docs/explanation/safety.md.
"""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import FrozenInstanceError
from threading import Thread

import pytest
from pydantic import ValidationError

import cosmic
from cosmic.frame.clock import WALL
from cosmic.frame.network.lease import StationLease
from cosmic.mico.api.application import MicoApplication
from cosmic.mico.core.collision.callback import CollisionCallbackBase, Response
from unit.mico.rigs import wait_until

LOW_UM = -1502.0
"""Of left.z, with the jaws 2 um inside the plate."""


@pytest.fixture(scope="module")
def platform() -> Iterator[cosmic.Rig]:
    with cosmic.connect(rate=1.0, applications=("mico",)) as rig:
        yield rig


@pytest.fixture
def rig(platform: cosmic.Rig) -> Iterator[cosmic.Rig]:
    yield platform
    platform.stop()
    platform.reset_stop()
    platform.mico.unlink("left.x")
    for axis in platform.mico:
        axis.clear_zero()
        axis.collision_detection = True
    for name in platform.mico.collision.contacts:
        application(platform).collision.forbid_contact(name)
    wait_until(lambda: not any(axis.details.in_motion for axis in platform.mico))
    platform.mico.move({"left.x": 0.0, "left.y": 0.0, "left.z": 0.0})


@pytest.fixture
def own_rig() -> Iterator[cosmic.Rig]:
    """For what ends the threads of the platform."""
    with cosmic.connect(applications=("mico",)) as rig:
        yield rig


@contextmanager
def moving(rig: cosmic.Rig, name: str = "left.x", to: float = 5400.0) -> Iterator[object]:
    """A movement that takes seconds."""
    axis = rig.mico[name]
    axis.set_closed_loop_frequency(300)
    movement = axis.move_to(to, wait=False)
    wait_until(lambda: axis.details.in_motion)
    try:
        yield movement
    finally:
        axis.halt()
        movement.exception(5.0)
        axis.set_closed_loop_frequency(5000)


def application(rig: cosmic.Rig) -> MicoApplication:
    found = rig.mico.application
    assert isinstance(found, MicoApplication)
    return found


FROZEN: dict[str, Callable[[MicoApplication], object]] = {
    "soft limits": lambda app: setattr(
        app.manager.settings.positioner[0], "limits_um", (-9e3, 9e3)
    ),
    "soft limits in force": lambda app: setattr(app.manager.state("left.x"), "limits", None),
    "travel of an estimate": lambda app: setattr(
        app.manager.settings.positioner[0], "travel_um", None
    ),
    "dead man": lambda app: setattr(app.manager.settings.jog, "dead_man_s", 60.0),
    "packets": lambda app: setattr(app.manager.settings.jog, "packet_s", 5.0),
    "stale positions": lambda app: setattr(app.manager.settings.watch, "stale_s", 1e9),
    "answer of the collision check": lambda app: setattr(
        app.manager.settings.watch, "collision_answer_s", 1e9
    ),
    "margins": lambda app: setattr(app.collision.model.pairs[0], "margin_um", 0.0),
    "pairs": lambda app: setattr(app.collision.model, "pairs", ()),
}


@pytest.mark.parametrize("change", FROZEN.values(), ids=FROZEN)
def test_what_stands_in_the_files_cannot_be_changed_while_the_program_runs(rig, change) -> None:
    with pytest.raises((ValidationError, FrozenInstanceError, AttributeError)):
        change(application(rig))


def test_a_zero_set_in_mid_movement_moves_no_soft_limit(rig: cosmic.Rig) -> None:
    with moving(rig):
        rig.mico["left.x"].set_zero()
        low, high = rig.mico["left.x"].limits
        assert high - low == pytest.approx(11000.0)
        assert not rig.mico.check({"left.x": high + 1.0}).allowed


def test_an_axis_taken_in_again_stops_what_began_without_the_check(rig: cosmic.Rig) -> None:
    left_z = rig.mico["left.z"]
    left_z.collision_detection = False
    with moving(rig, "left.z", -2500.0) as movement:
        left_z.collision_detection = True
        error = movement.exception(5.0)
        assert isinstance(error, cosmic.MoveCancelled)
        assert "checked for collisions again" in str(error)
    assert left_z.position_um > -1500.0


def test_a_jog_of_an_axis_taken_in_again_keeps_the_margin(rig: cosmic.Rig, caplog) -> None:
    left_z = rig.mico["left.z"]
    left_z.move_to(-1400.0)
    with left_z.jog(-1, speed=200.0) as jog:
        wait_until(lambda: left_z.details.in_motion)
        left_z.collision_detection = False
        assert "NOT checked" in caplog.text
        jog.renew()
        left_z.collision_detection = True
        until_s = WALL.now_s() + 2.0
        while not jog.done and WALL.now_s() < until_s:
            jog.renew()
            WALL.sleep(0.02)
    jog.movement.exception(2.0)
    assert -1496.5 < left_z.position_um < -1450.0, "it would be at -1800 without the check"


@pytest.mark.parametrize("how", ["block", "forbidden"])
def test_a_contact_ends_with_its_operation_and_so_does_what_it_allowed(rig, how) -> None:
    rig.mico["left.z"].move_to(-1400.0)
    collision = rig.mico.collision
    if how == "block":
        with ExitStack() as ends:
            with collision.contact("grasp"):
                movement = ends.enter_context(moving(rig, "left.z", LOW_UM))
            assert "checked for collisions again" in str(movement.exception(5.0))
    else:
        model = application(rig).collision
        model.allow_contact("grasp")
        with moving(rig, "left.z", LOW_UM) as movement:
            model.forbid_contact("grasp")
            assert "checked for collisions again" in str(movement.exception(5.0))
    assert not collision.allowed_contacts
    assert not rig.mico.check({"left.z": LOW_UM}).allowed
    assert rig.mico["left.z"].position_um > -1499.0


@pytest.mark.parametrize("name", ["probe.y", "left.x"])
def test_a_contact_that_ends_leaves_alone_what_did_not_need_it(rig: cosmic.Rig, name: str) -> None:
    with moving(rig, name, 1000.0) as movement:
        with rig.mico.collision.contact("grasp"):
            pass
        WALL.sleep(0.1)
        assert not movement.done
    rig.mico[name].move_to(0.0)


def test_a_response_taken_back_stops_what_moves_by_it(rig: cosmic.Rig) -> None:
    class Shrugs(CollisionCallbackBase):
        def on_contact(self, approach: object, spans: object) -> Response:
            return Response.IGNORE

    collision = rig.mico.collision
    for jaw in ("left_jaw_a", "left_jaw_b"):
        collision.set_callback(jaw, "plate", Shrugs())
    with moving(rig, "left.z", LOW_UM) as movement:
        collision.set_callback("left_jaw_a", "plate", None)
        assert "checked for collisions again" in str(movement.exception(5.0))
    collision.set_callback("left_jaw_b", "plate", None)


def test_links_change_only_while_their_axes_stand(rig: cosmic.Rig) -> None:
    with moving(rig), pytest.raises(cosmic.NotAvailable, match="is moving"):
        rig.mico.link("left.x", "right.x")
    rig.mico.link("left.x", "right.x", -1.0)
    movement = rig.mico.move_by({"left.x": -900.0}, wait=False)
    wait_until(lambda: rig.mico["right.x"].details.in_motion)
    for name in ("left.x", "right.x"):
        with pytest.raises(cosmic.NotAvailable, match="is moving"):
            rig.mico.unlink(name)
    movement.wait(20.0)
    rig.mico.move({"left.x": 0.0})
    assert rig.mico.unlink("right.x")


def test_a_speed_set_in_a_jog_counts_from_the_next_movement(rig: cosmic.Rig) -> None:
    axis = rig.mico["left.x"]
    controller = application(rig).manager.controller
    frequencies_hz: list[int] = []
    real = controller.set_closed_loop_frequency
    controller.set_closed_loop_frequency = lambda channel, hz: (
        frequencies_hz.append(hz),
        real(channel, hz),
    )
    try:
        with axis.jog(1, speed=50.0) as jog:
            wait_until(lambda: axis.details.in_motion)
            frequencies_hz.clear()
            axis.set_closed_loop_frequency(18500)
            for _ in range(10):
                jog.renew()
                WALL.sleep(0.02)
            assert 18500 not in frequencies_hz
        jog.movement.exception(2.0)
        wait_until(lambda: frequencies_hz[-1:] == [18500])
    finally:
        controller.set_closed_loop_frequency = real
        axis.set_closed_loop_frequency(5000)


def test_a_jog_that_another_one_keeps_alive_ends_at_its_own_dead_man(rig: cosmic.Rig) -> None:
    first = rig.mico["left.x"].jog(1, speed=20.0)
    other = rig.mico["left.y"].jog(1, speed=20.0)
    until_s = WALL.now_s() + 3.0
    while not first.done and WALL.now_s() < until_s:
        other.renew()
        WALL.sleep(0.01)
    assert first.done
    other.end()


def test_a_stop_outlives_a_rescan_and_a_reset_starts_nothing_again(own_rig: cosmic.Rig) -> None:
    rig = own_rig
    with moving(rig) as movement:
        rig.stop()
        assert isinstance(movement.exception(5.0), cosmic.StoppedError)
        application(rig).manager.rescan()
        with pytest.raises(cosmic.StoppedError):
            rig.mico["left.y"].move_to(1.0)
        rig.reset_stop()
        here = rig.mico["left.x"].position_um
        WALL.sleep(0.1)
        assert rig.mico["left.x"].position_um == pytest.approx(here, abs=0.5)


def test_a_rescan_waits_for_no_movement_and_keeps_what_is_taken_out(own_rig: cosmic.Rig) -> None:
    rig = own_rig
    rig.mico["left.y"].collision_detection = False
    with moving(rig), pytest.raises(cosmic.NotAvailable, match="is moving"):
        application(rig).manager.rescan()
    application(rig).manager.rescan()
    assert rig.mico.collision.unwatched == {"left.y"}


def test_a_rescan_between_orders_lets_nothing_through(own_rig: cosmic.Rig) -> None:
    rig = own_rig
    manager, over = application(rig).manager, []

    def command(name: str) -> None:
        while not over:
            try:
                rig.mico[name].move_by(1.0)
                rig.mico[name].move_by(-1.0)
            except cosmic.CosmicError:
                WALL.sleep(0.005)

    threads = [Thread(target=command, args=(name,)) for name in ("left.x", "left.y", "right.x")]
    for thread in threads:
        thread.start()
    done = 0
    for _ in range(40):
        try:
            manager.rescan()
            done += 1
        except cosmic.NotAvailable:
            WALL.sleep(0.01)
    over.append(True)
    for thread in threads:
        thread.join(10.0)
    if not manager.ready:
        manager.rescan()
    wait_until(lambda: not manager.gate.held())
    assert not any(axis.details.in_motion for axis in rig.mico)
    assert abs(rig.mico["left.x"].position_um) < 10.0 * (done + 40)


def test_when_control_passes_local_jogs_end_and_movements_go_on_to_their_end(
    own_rig: cosmic.Rig,
) -> None:
    station = StationLease()
    application(own_rig).manager.lease.join(station)
    left, right = own_rig.mico["left.x"], own_rig.mico["right.x"]
    with moving(own_rig, to=300.0) as movement, right.jog(1, speed=100.0) as jog:
        wait_until(lambda: right.details.in_motion)
        station.take("vision", "t" * 32, in_process=True)

        def ended() -> bool:
            jog.renew()
            return jog.done

        wait_until(ended)
        assert "vision controls the platform now" in str(jog.movement.exception(5.0))
        wait_until(lambda: not right.details.in_motion)
        assert not movement.done, "it goes on"
        assert movement.exception(20.0) is None
    assert left.position_um == pytest.approx(300.0, abs=1.0)
    with pytest.raises(cosmic.MoveRefused, match="vision controls the platform now"):
        left.move_to(0.0)
    station.take_over()
    left.move_to(0.0)
