"""Stages through pylablib and PI's package: what each is told, and what becomes of trouble."""

import math
import sys
from types import ModuleType

import pytest

from contract.controller_rig import Rig
from contract.fake_stages import FakePipython, FakePylablib, GCSError, RefusedError
from cosmic.frame.errors import DeviceError, DeviceFault, NotConnectedError
from cosmic.mico.hw import pipython_stages, pylablib_stages
from cosmic.mico.hw.factory import make_controller
from cosmic.mico.hw.interface import Activity, Channel, Failed, PositionKnownRead, TypeRead
from cosmic.mico.hw.interface import ReferenceKind as Kind
from cosmic.mico.hw.stages import StageController

AT, ROTARY, PICOMOTOR = Channel(0, 0), Channel(3, 0), Channel(3, 1)
MAKES = [(FakePylablib, pylablib_stages), (FakePipython, pipython_stages)]


@pytest.fixture(params=MAKES, ids=["pylablib", "pi"])
def made(request):
    fake, module = request.param
    package = fake()
    controller = module.make_controller(package.controller_options(), package)
    with Rig(controller) as rig:
        yield rig, package


@pytest.fixture
def pylablib():
    package = FakePylablib()
    with Rig(pylablib_stages.make_controller(package.controller_options(), package)) as rig:
        yield rig, package


@pytest.fixture
def pi():
    package = FakePipython()
    with Rig(pipython_stages.make_controller(package.controller_options(), package)) as rig:
        yield rig, package


def devices(package):
    return list(package.devices.values())


def test_pylablib_gets_metres_and_the_position_by_each_class_own_name(pylablib):
    rig, package = pylablib
    rig.controller.move_to(AT, 120.0, "um", hold_s=0.0)
    rig.controller.step(PICOMOTOR, 30, amplitude_v=50.0, frequency_hz=700)
    kinesis, picomotor = package.devices["27000000"], package.devices["27000003"]
    assert kinesis.axes.position[0] == pytest.approx(120e-6)
    assert picomotor.axes.position[1] == 30
    assert ("speed", 1, 700) in picomotor.axes.calls


def test_pi_gets_millimetres_and_its_servo_is_switched_on_for_it(pi):
    rig, package = pi
    rig.controller.move_by(AT, -250.0, "um", hold_s=math.inf)
    device = devices(package)[0]
    assert device.axes.position["1"] == pytest.approx(-0.25)
    assert device.servo == {"1": True, "2": False, "3": False}


def test_a_stop_does_not_wait_for_the_stage_to_stand(made):
    rig, package = made
    rig.controller.move_to(AT, 100.0, "um", hold_s=0.0)
    rig.controller.stop(AT)
    calls = devices(package)[0].axes.calls
    assert calls in ([("stop", 0, True, False)], [("HLT", "1")])
    assert rig.activity(AT) is Activity.STOPPED


def test_a_stop_while_the_library_is_busy_is_made_right_after_that_call(made):
    rig, package = made
    device = devices(package)[0]
    real = device.axes.go

    def stopped_meanwhile(name, position):
        real(name, position)
        rig.controller.stop(AT)  # as another thread would, which must not wait here
        assert not device.axes.calls

    device.axes.go = stopped_meanwhile
    rig.controller.move_to(AT, 100.0, "um", hold_s=0.0)
    assert len(device.axes.calls) == 1


def test_looking_for_the_reference_returns_at_once_and_makes_the_position_known(made):
    rig, _ = made
    rig.controller.ask_position_known(AT)
    assert not rig.event(PositionKnownRead, AT).known
    rig.controller.reference(AT, hold_s=math.inf)
    assert rig.activity(AT) is Activity.REFERENCING
    assert rig.come_to_rest(AT) is Activity.HOLDING
    rig.controller.ask_position_known(AT)
    assert rig.event(PositionKnownRead, AT).known


def test_a_stage_that_cannot_be_homed_says_so(pylablib):
    rig, _ = pylablib
    rig.controller.ask_type(ROTARY)
    assert rig.event(TypeRead, ROTARY).positioner.reference is Kind.NONE
    with pytest.raises(DeviceError) as caught:
        rig.controller.reference(ROTARY, hold_s=0.0)
    assert caught.value.fault is DeviceFault.UNSUPPORTED


def test_an_unplugged_device_is_reported_at_once_and_spares_the_others(made):
    rig, package = made
    devices(package)[0].axes.gone = True
    with pytest.raises(DeviceError) as caught:
        rig.controller.stop(AT)
    assert caught.value.fault is DeviceFault.COMMUNICATION
    rig.controller.ask_activity(AT)
    with pytest.raises(DeviceError):
        for _ in range(5):
            event = rig.controller.receive(0, 0.1)
            assert isinstance(event, Failed)
    assert rig.activity(Channel(1, 0)) is Activity.STOPPED


@pytest.mark.parametrize(
    ("code", "fault"),
    [(7, DeviceFault.PARAMETER), (5, DeviceFault.STATE), (-7, DeviceFault.COMMUNICATION)],
)
def test_error_codes_of_pi_keep_their_meaning(pi, code, fault):
    rig, package = pi

    def fails(name, position):
        raise GCSError(code)

    devices(package)[0].axes.go = fails
    with pytest.raises(DeviceError, match=f"GCS error {code}") as caught:
        rig.controller.move_to(AT, 1.0, "um", hold_s=0.0)
    assert caught.value.fault is fault


def test_a_refusal_of_pylablib_fails_the_command_with_its_words(pylablib):
    rig, package = pylablib

    def fails(name, position):
        raise RefusedError("not enabled")

    devices(package)[0].axes.go = fails
    with pytest.raises(DeviceError, match="not enabled"):
        rig.controller.move_to(AT, 1.0, "um", hold_s=0.0)


def test_a_device_that_cannot_be_stopped_is_not_driven(pylablib):
    _, package = pylablib
    options = package.controller_options().stages[0]
    kinesis = package.kinesis

    def without_stop(conn):
        device = kinesis(conn)
        device.stop = None
        return device

    package.kinesis = without_stop
    with pytest.raises(NotConnectedError, match="has no stop"):
        pylablib_stages.PylablibUnit(options, package)


def test_a_device_that_cannot_be_closed_either_is_named_as_one(pylablib):
    _, package = pylablib
    options = package.controller_options().stages[0]
    package.device_class = lambda _name: lambda *_arguments, **_keywords: object()
    with pytest.raises(NotConnectedError, match="has no move_by, is_moving, stop, close"):
        pylablib_stages.PylablibUnit(options, package)


def test_a_controller_of_pi_that_does_not_say_what_it_is_is_disconnected():
    package = FakePipython()
    stage = package.controller_options().stages[0]
    connect = package.connect

    def connect_to_one_that_is_silent(options):
        device, disconnect = connect(options)
        device.axes.gone = True
        device.qIDN = device.axes.check
        return device, disconnect

    package.connect = connect_to_one_that_is_silent
    with pytest.raises(NotConnectedError, match="does not answer: unplugged"):
        pipython_stages.PiUnit(stage, package)
    assert devices(package)[0].axes.calls == ["close"]


def test_the_line_to_a_controller_that_pipython_does_not_know_is_closed(monkeypatch):
    closed = []

    class Socket:
        def __init__(self, host, port):
            assert (host, port) == ("192.168.0.5", 50_000)

        def close(self):
            closed.append(self)

    def refuse(_controller, gateway):
        raise KeyError(f"no such controller, over {gateway}")

    package, lines = ModuleType("pipython"), ModuleType("pisocket")
    package.__version__, package.GCSError, package.GCSDevice = "2.11.0", GCSError, refuse
    lines.PISocket = Socket
    monkeypatch.setitem(sys.modules, "pipython", package)
    monkeypatch.setitem(sys.modules, "pipython.pidevice.interfaces.pisocket", lines)
    options = {"serial": 1, "controller": "C-0", "connect": "tcpip", "at": "192.168.0.5"}
    stage = pipython_stages.PiStage.model_validate({**options, "axes": [{"axis": 1}]})
    with pytest.raises(NotConnectedError, match="no such controller"):
        pipython_stages.PiUnit(stage, pipython_stages.InstalledPackage())
    assert len(closed) == 1


def test_devices_that_were_open_already_are_closed_when_a_later_one_fails():
    package = FakePylablib()
    stage = package.controller_options().stages[0]

    def failing():
        raise DeviceError("this firmware is too old", fault=DeviceFault.UNSUPPORTED)

    opens = [lambda: pylablib_stages.PylablibUnit(stage, package), failing]
    with pytest.raises(DeviceError, match="too old"):
        StageController("stages", opens).open()
    assert devices(package)[0].axes.calls[-1] == "close"


@pytest.mark.parametrize(
    ("backend", "module", "options"),
    [
        (
            "pylablib",
            "pylablib",
            {"stages": [{"serial": 1, "device": "Thorlabs.KinesisMotor", "axes": [{"axis": 1}]}]},
        ),
        (
            "pi",
            "pipython",
            {"stages": [{"serial": 1, "controller": "C-884", "at": "0119", "axes": [{"axis": 1}]}]},
        ),
    ],
)
def test_a_package_that_is_missing_is_named_with_how_to_install_it(
    monkeypatch, backend, module, options
):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(NotConnectedError, match=rf"{module} is missing.*cosmic\[{backend}\]"):
        make_controller(backend, options=options)


def test_a_stage_without_a_sensor_needs_no_positions(pylablib):
    _, package = pylablib
    options = package.controller_options().stages[3]
    open_loop = [{"axis": 1, "kind": "open-loop", "unit": "step"}]
    options = type(options).model_validate({**options.model_dump(), "axes": open_loop})
    picomotor = package.picomotor

    def without_position(conn):
        device = picomotor(conn)
        device.get_position = device.move_to = None
        return device

    package.picomotor = without_position
    pylablib_stages.PylablibUnit(options, package).close()


def test_a_package_that_a_class_of_pylablib_needs_is_named(monkeypatch, tmp_path):
    for name, text in {
        "pylablib/__init__.py": "__version__ = '1.4.3'",
        "pylablib/core/devio/base.py": "class DeviceError(Exception): pass",
        "pylablib/devices/Thorlabs.py": "import a_compiler",
    }.items():
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(text, encoding="utf-8")
    for name in [each for each in sys.modules if each.partition(".")[0] == "pylablib"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.syspath_prepend(tmp_path)
    before = set(sys.modules)
    try:
        package = pylablib_stages.InstalledPackage()
        with pytest.raises(NotConnectedError, match="needs the package a_compiler"):
            package.device_class("Thorlabs.KinesisMotor")
        with pytest.raises(NotConnectedError, match=r"no device 'Thorlab.KinesisMotor'"):
            package.device_class("Thorlab.KinesisMotor")
    finally:
        for name in set(sys.modules) - before:
            del sys.modules[name]
