import gc
import subprocess
import sys
import threading

import pytest
from PySide6.QtCore import SIGNAL

import cosmic
from cosmic.frame.clock import WALL
from cosmic.frame.errors import DeviceError, DeviceFault
from cosmic.frame.threads import running_threads
from cosmic.mico.core.motion.device_commander import CommanderType, DeviceCommander
from cosmic.mico.core.motion.manager import Mode
from cosmic.mico.core.motion.positioner import Status
from cosmic.mico.hw.interface import PositionerKind
from unit.mico.rigs import listen, mico, wait_until


def test_types_are_detected_and_empty_channels_are_left_out():
    with mico(("LRN", "LNx"), configured=("LRN", "Lxx")) as (rig, _):
        assert [axis.kind for axis in rig] == [
            PositionerKind.LINEAR,
            PositionerKind.ROTARY,
            PositionerKind.OPEN_LOOP,
            PositionerKind.LINEAR,
        ]
        assert rig.application.manager.mode is Mode.RUN_TIME


def test_sixteen_devices_work():
    with mico(("LLL",) * 16) as (rig, _):
        assert len(rig) == 48
        targets = {name: float(i) for i, name in enumerate(rig.names)}
        assert rig.move(targets) == targets


def test_a_sensor_that_nobody_configured_is_shown_and_does_not_move():
    with mico(("LL",), configured=("L",)) as (rig, controller):
        assert rig.names == ["d0.c0", "device0.channel1"]
        with pytest.raises(cosmic.MoveRefused, match="not in the configuration") as refused:
            rig["device0.channel1"].move_to(0.0)
        assert refused.value.verdict.reason == "DEVICE"
        assert not controller.of("move_to")


def test_a_missing_device_is_named_and_the_others_work():
    with mico(("L",), configured=("L", "LN")) as (rig, _):
        assert rig.missing == ("device 1 was not found (d1.c0, d1.c1)",)
        assert rig.names == ["d0.c0", "d1.c0", "d1.c1"]
        assert rig["d1.c0"].state is Status.UNKNOWN
        with pytest.raises(cosmic.MoveRefused, match="rescan") as refused:
            rig["d1.c0"].move_to(1.0)
        assert refused.value.verdict.reason == "DEVICE"
        assert rig["d0.c0"].move_to(1.0) == 1.0


def test_a_missing_device_never_shifts_the_others_onto_foreign_axes():
    def unplug(controller):
        controller.unplugged = {0}

    found, configured = ("LLN", "LRN", "RLN"), ("LLN", "RLN", "LRN")
    with mico(found, prepare=unplug, configured=configured, serials=(100, 102, 101)) as opened:
        rig, controller = opened
        assert rig.missing == ("device 0 was not found (d0.c0, d0.c1, d0.c2)",)
        assert rig["d1.c1"].move_to(7.0) == 7.0
        assert rig["d2.c0"].move_to(8.0) == 8.0
        sent = {call[2]: controller.opened[call[1].device] for call in controller.of("move_to")}
        assert sent == {7.0: 102, 8.0: 101}


def test_none_of_the_configured_devices_opens_no_foreign_one():
    def unplug(controller):
        controller.unplugged = {0}

    with mico(("L", "L"), prepare=unplug, configured=("L",), serials=(100,)) as (rig, controller):
        assert "none of the configured devices" in rig.application.failure
        assert "100" in rig.application.failure
        assert controller.opened == []


def test_a_rescan_adds_what_was_missing():
    with mico(("L",), configured=("L", "LN")) as (rig, controller):
        axis = rig["d1.c0"]
        controller.layout.append("LN")
        rig.rescan()
        assert rig.missing == ()
        wait_until(lambda: axis.details.position is not None)
        assert axis.move_to(5.0) == 5.0


def test_no_rescan_while_something_moves():
    with mico(instant=False) as (rig, controller):
        rig["d0.c0"].move_to(5.0, wait=False)
        wait_until(lambda: bool(controller.of("move_to")))
        with pytest.raises(cosmic.NotAvailable, match=r"d0\.c0 is moving"):
            rig.rescan()


def test_a_wrong_kind_is_an_error_of_that_axis_only():
    with mico(("NL",), configured=("LL",)) as (rig, _):
        assert "finds open-loop" in rig["d0.c0"].error
        with pytest.raises(cosmic.MoveRefused):
            rig["d0.c0"].move_to(1.0)
        assert rig["d0.c1"].move_to(1.0) == 1.0


def test_a_device_lost_in_motion_fails_its_moves_and_stops_everything():
    with mico(("LL", "LL"), instant=False) as (rig, controller):
        lost = listen(rig.application.manager.device_lost)
        movement = rig["d0.c0"].move_to(5.0, wait=False)
        wait_until(lambda: bool(controller.of("move_to")))
        controller.broken = DeviceError("usb gone", fault=DeviceFault.COMMUNICATION)
        with pytest.raises(cosmic.NotConnectedError, match="usb gone"):
            movement.wait(3)
        wait_until(lambda: rig.application.manager.latch.state.latched)
        assert rig["d0.c0"].state is Status.UNKNOWN
        wait_until(lambda: bool(lost))
        assert any("device 0" in line for line in rig.missing)


def test_nothing_connected_leaves_mico_open_with_the_reason():
    def nothing(controller):
        def fail(serials=()):
            raise cosmic.NotConnectedError("no SCU found")

        controller.open = fail

    controller = None
    from cosmic.frame.clock import RatedClock
    from cosmic.frame.failure import FailurePolicy
    from cosmic.mico.api.application import MicoApplication
    from unit.mico.rigs import settings
    from unit.mico.scripted_controller import ScriptedController

    controller = ScriptedController(("LLN",))
    nothing(controller)
    application = MicoApplication(
        controller, settings(), clock=RatedClock(1.0), policy=FailurePolicy()
    )
    application.initialize()
    try:
        assert application.failure == "no SCU found"
        assert application.manager.mode is Mode.FAILED
    finally:
        application.shut_down()


def test_closing_while_moving_stops_and_ends_the_movement():
    with mico(instant=False) as (rig, controller):
        movement = rig["d0.c0"].move_to(5.0, wait=False)
        wait_until(lambda: bool(controller.of("move_to")))
        before = WALL.now_s()
        rig.application.shut_down()
        assert WALL.now_s() - before < 2.0
        assert controller.calls[-1] == ("close",)
        assert controller.of("stop")
        with pytest.raises(cosmic.CosmicError):
            movement.wait(1)
        with pytest.raises(cosmic.MoveRefused):
            rig["d0.c0"].move_to(1.0)


def test_a_listener_that_hangs_in_the_library_is_left_behind_and_keeps_it_from_being_opened():
    with mico() as (rig, controller):
        held, go_on = threading.Event(), threading.Event()
        receive = controller.receive

        def never(device, timeout_s):
            held.set()
            go_on.wait(30.0)
            return receive(device, timeout_s)

        controller.receive = never
        assert held.wait(5.0)
        try:
            with pytest.raises(cosmic.CosmicError, match="listener 0 still hangs in the library"):
                rig.rescan()
        finally:
            go_on.set()
        wait_until(lambda: not any("listener" in each.name for each in running_threads()))
        rig.rescan()
        assert rig["d0.c0"].move_to(5.0) == 5.0


def test_a_commander_hears_and_commands_only_what_it_was_connected_for():
    with mico() as (rig, _):
        manager = rig.application.manager
        listens = DeviceCommander(manager.lease.holder.token)
        heard = listen(listens.movement_ended)
        manager.connect_device_commander(0, listens, CommanderType.OUTPUT)
        with pytest.raises(cosmic.NotConnectedError):
            listens.move_absolute(0, 1.0, "um")
        commands = DeviceCommander(manager.lease.holder.token)
        deaf = listen(commands.movement_ended)
        manager.connect_device_commander(0, commands, CommanderType.INPUT)
        assert commands.move_absolute(0, 1.0, "um").wait(2) == 1.0
        wait_until(lambda: bool(heard))
        assert heard[0].name == "d0.c0"
        assert not deaf


def test_a_commander_without_the_lease_moves_nothing():
    with mico() as (rig, controller):
        stranger = DeviceCommander("guessed")
        rig.application.manager.connect_device_commander(0, stranger)
        with pytest.raises(cosmic.MoveRefused) as refused:
            stranger.move_absolute(0, 1.0, "um").wait(2)
        assert refused.value.verdict.reason == "NO_LEASE"
        assert not controller.of("move_to")


DROPPED = """
import gc, sys, threading, time
from PySide6.QtCore import QCoreApplication, QObject, Signal
from cosmic.mico.core.motion.device_commander import CommanderType, DeviceCommander

class Device(QObject):
    position_changed = Signal(object)
    state_changed = Signal(object)
    movement_ended = Signal(object)
    movement_refused = Signal(object)

class Script:
    def __init__(self):
        self.itself = self
        self.commander = DeviceCommander("token")
        self.commander.attach(device, CommanderType.OUTPUT)

def emit():
    while not ended:
        device.state_changed.emit(1)

app, device, ended = QCoreApplication([]), Device(), []
thread = threading.Thread(target=emit)
sys.setswitchinterval(1e-4)
thread.start()
until_s = time.monotonic() + 2.0
while time.monotonic() < until_s:
    for _ in range(20):
        Script()
    gc.collect()
ended.append(True)
thread.join()
"""


def test_a_commander_that_is_deleted_while_its_device_emits_ends_no_process():
    """The collector deletes it, in any thread: the process must live on."""
    done = subprocess.run(
        [sys.executable, "-X", "faulthandler", "-c", DROPPED],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.returncode == 0, done.stderr


def test_a_commander_that_was_dropped_leaves_nothing_at_its_device():
    with mico() as (rig, _):
        manager = rig.application.manager
        device = manager.devices[0]

        def receivers():
            return device.receivers(SIGNAL("state_changed(PyObject)"))

        before = receivers()
        dropped = DeviceCommander(manager.lease.holder.token)
        manager.connect_device_commander(0, dropped, CommanderType.OUTPUT)
        assert receivers() == before + 1
        del dropped
        gc.collect()
        assert receivers() == before
