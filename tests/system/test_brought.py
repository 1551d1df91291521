"""What a package outside of the tree brings works on a platform that names it."""

import re
import sys
import textwrap
import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

import cosmic
from contract.station_rig import free_port, wait_until
from cosmic.app.cli import main
from cosmic.app.configuration.network import NetworkSettings, serving
from cosmic.app.platform import build_platform
from cosmic.app.rig import Rig
from cosmic.app.stations.host import StationHost
from cosmic.daqco.api.application import HANG_S
from cosmic.frame.clock import WALL
from cosmic.frame.plugins import find_backend
from cosmic.frame.time_scale import LONGEST_HOLD_S

POINTS = """
[cosmic.applications]
heater = {0}:HEATER
unserved = {0}:UNSERVED
broken = no_such_package:BACKEND
[cosmic.contacts]
shrug = {0}:SHRUG
[cosmic.exporters]
rows = {0}:ROWS
[cosmic.analyses]
brightness = {0}:BRIGHTNESS
broken = no_such_package:BACKEND
[cosmic.procedures]
look = {0}:LOOK
[cosmic.positioners]
careful = {0}:CAREFUL
[cosmic.inputs]
pedal = {0}:PEDAL
"""

CODE = """
from pathlib import Path
from typing import ClassVar

from cosmic.app.applications import ApplicationBackend
from cosmic.autonomy.handling.settings import HandlingSettings
from cosmic.autonomy.shipped.bend_test import build_transport
from cosmic.autonomy.shipped.registry import ShippedProcedure, procedure_backend
from cosmic.daqco.api.export import ExporterBackend
from cosmic.frame.application import CosmicApplicationBase
from cosmic.frame.config import StrictModel
from cosmic.frame.declaration import Declared, stream
from cosmic.frame.network.transport import Rule
from cosmic.mico.core.collision.callback import CollisionCallbackBase, ContactBackend, Response
from cosmic.mico.core.motion.orders import MoveTo
from cosmic.mico.core.motion.positioner import (
    LinearPositioner,
    PositionerBackend,
    PositionerDriver,
)
from cosmic.mico.hw.input_device import InputBackend, InputInfo, InputKind, InputSource
from cosmic.vico.core.vision.chain import AnalysisBackend


class Options(StrictModel):
    to_um: float


class Heater(CosmicApplicationBase):
    def __init__(self, options, context):
        super().__init__("Heater", context.site.policy)
        self._mico, self._to_um = context.mico, options.to_um
        self.initialised = False

    def initialize(self):
        self.initialised = True

    def go(self):
        return self._mico["left.x"].move_to(self._to_um)


class Mute(Declared):
    @stream(Rule.ALL)
    def on_heard(self, receiver):
        return lambda: None


class Unserved(Heater):
    @property
    def interface(self):
        return Mute()


class Shrug(CollisionCallbackBase):
    def on_contact(self, approach, spans):
        return Response.IGNORE


class Brightness:
    name = "brightness"

    def __init__(self, scale):
        self._scale = scale

    def run(self, image, results):
        return self._scale * float(image.data.mean())


class Scale(StrictModel):
    scale: float = 1.0


class CarefulPositioner(LinearPositioner):
    motions: ClassVar = (MoveTo,)
    advice = "it only moves to positions"


class Pedal(InputSource):
    def devices(self):
        return (InputInfo("pedal:0", "Pedal", InputKind.JOYSTICK, ("x",)),)

    def open(self, key):
        raise NotImplementedError

    def close(self):
        pass


def export_rows(recording, path, progress=None, *, overwrite=False):
    path.write_text(f"{recording.samples} rows of {', '.join(recording.channels)}")
    return path


UNSERVED = ApplicationBackend(Unserved, options=Options)
HEATER = ApplicationBackend(Heater, options=Options)
SHRUG = ContactBackend(lambda options, context: Shrug())
ROWS = ExporterBackend(lambda options, context: export_rows)
BRIGHTNESS = AnalysisBackend(lambda options, context: Brightness(options.scale), options=Scale)
LOOK = procedure_backend(ShippedProcedure(build_transport, measures=False))
CAREFUL = PositionerBackend(lambda options, context: PositionerDriver(CarefulPositioner))
PEDAL = InputBackend(lambda options, context: Pedal())
"""

Edit = Callable[..., Path]


@pytest.fixture
def laboratory(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Iterator[Edit]:
    """Install a package that brings one of each kind; returns what edits a platform file."""
    find_backend.cache_clear()
    module = f"labware_of_{tmp_path.name.replace('-', '_')}"
    package = tmp_path / "labware"
    described = package / "labware-1.2.dist-info"
    described.mkdir(parents=True)
    (package / f"{module}.py").write_text(textwrap.dedent(CODE), encoding="utf-8")
    (described / "METADATA").write_text("Name: labware\nVersion: 1.2\n", encoding="utf-8")
    (described / "entry_points.txt").write_text(POINTS.format(module), encoding="utf-8")
    monkeypatch.syspath_prepend(str(package))
    folder = tmp_path / "config"
    assert main(["init", str(folder)]) == 0
    file = folder / "platform.toml"

    def edit(*changes: tuple[str, str]) -> Path:
        text = file.read_text(encoding="utf-8")
        for old, new in changes:
            assert old in text
            text = text.replace(old, new, 1)
        file.write_text(text, encoding="utf-8")
        capsys.readouterr()
        return folder

    yield edit
    find_backend.cache_clear()
    sys.modules.pop(module, None)


APPLICATIONS = 'applications = ["mico", "daqco", "vico"]'


def test_a_fourth_application_moves_through_the_gate_beside_the_three(laboratory: Edit) -> None:
    folder = laboratory(
        (APPLICATIONS, 'applications = ["mico", "heater", "broken"]'),
        ("[mico]\n", "[application.heater]\nto_um = 25.0\n\n[mico]\n"),
    )
    with cosmic.connect(folder, rate=20) as rig:
        heater = rig.application("heater")
        assert heater.initialised
        assert heater.go() == pytest.approx(25.0, abs=1.0)
        rig.stop()
        with pytest.raises(cosmic.MoveRefused, match="stop"):
            heater.go()
        with pytest.raises(cosmic.NotAvailable, match=r"labware 1\.2.*no_such_package"):
            rig.application("broken")
        with pytest.raises(cosmic.NotAvailable, match="heater"):
            rig.application("cooler")


def test_an_application_whose_declaration_is_wrong_is_not_served_and_the_others_are(
    laboratory: Edit, caplog: pytest.LogCaptureFixture
) -> None:
    folder = laboratory(
        (APPLICATIONS, 'applications = ["mico", "unserved"]'),
        ("[mico]\n", "[application.unserved]\nto_um = 25.0\n\n[mico]\n"),
    )
    platform = build_platform(folder)
    with Rig(platform):
        how = serving(
            NetworkSettings(), "lab", platform.path, listen=f"tcp/127.0.0.1:{free_port()}"
        )
        StationHost(platform, how).close()
    (said,) = (each.getMessage() for each in caplog.records if "not served" in each.getMessage())
    assert "application unserved" in said
    assert "Mute.on_heard cannot be a stream: it takes one receiver, annotated as" in said


def test_a_check_reads_the_options_of_all_that_is_named(
    laboratory: Edit, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = laboratory(
        (APPLICATIONS, 'applications = ["mico", "heater"]\nrequires = ["labware", "other>=2"]'),
        ("[vico]\n", "[vico.analysis.brightness]\nscal = 2.0\n\n[vico]\n"),
    )
    assert main(["check", str(folder)]) == 1
    said = capsys.readouterr().err
    assert "application: options of application 'heater': to_um: key is missing" in said
    assert "vico: options of analysis 'brightness': scal: unknown key" in said
    assert "platform.requires: other>=2 is not installed: pip install 'other>=2'" in said
    assert "labware" not in said.replace("options", "")


def test_a_response_to_a_contact_needs_a_pair_that_is_watched(laboratory: Edit) -> None:
    contact = '[[mico.contact]]\nbodies = ["left_jaw_a", "left_jaw_b"]\nresponse = "shrug"\n\n'
    folder = laboratory(("[[mico.group]]\n", f"{contact}[[mico.group]]\n"))
    with pytest.raises(cosmic.ConfigError, match="left_jaw_a and left_jaw_b are not watched"):
        cosmic.connect(folder, applications=("mico",))


def test_its_algorithm_is_in_the_chain_of_the_camera_that_names_it(laboratory: Edit) -> None:
    folder = laboratory(
        ("[[vico.camera]]\n", '[[vico.camera]]\nalgorithms = ["focus", "brightness", "broken"]\n'),
        ("[vico]\n", "[vico.analysis.brightness]\nscale = 2.0\n\n[vico]\n"),
    )
    assert main(["check", str(folder)]) == 1, "one of them cannot be loaded"
    with cosmic.connect(folder, applications=("mico", "vico")) as rig:
        image = rig.vico.snap()
        chain = rig.vico.application.unit(rig.vico.cameras[0]).chain
        states = [each.name for each in chain.states]
        assert {"brightness", "broken"} <= set(states)
        assert image.mean() > 0


def test_its_exporter_is_a_format(laboratory: Edit, tmp_path: Path) -> None:
    laboratory()
    with cosmic.connect(applications=("mico", "daqco")) as rig, rig.daqco.record(tmp_path / "a.h5"):
        rig.daqco.latest()
    assert main(["export", str(tmp_path / "a.h5"), "--to", "rows"]) == 0
    assert "rows of" in (tmp_path / "a.rows").read_text()


def test_its_positioner_type_says_what_the_axis_can_do(laboratory: Edit) -> None:
    folder = laboratory(('name = "left.x"\n', 'name = "left.x"\ntype = "careful"\n'))
    with cosmic.connect(folder, applications=("mico",), rate=20) as rig:
        assert rig.mico["left.x"].move_to(30.0) == pytest.approx(30.0, abs=1.0)
        with pytest.raises(cosmic.MoveRefused, match="it only moves to positions"):
            rig.mico["left.x"].move_by(5.0)
        assert rig.mico["left.y"].move_by(5.0) is not None


def test_its_input_device_is_listed(laboratory: Edit) -> None:
    folder = laboratory(("[mico.teleoperation]\n", '[mico.teleoperation]\ninputs = ["pedal"]\n'))
    with cosmic.connect(folder, applications=("mico",)) as rig:
        listed = [each.key for each in rig.mico.teleoperation.devices()]
    assert "pedal:0" in listed


def test_its_procedure_is_named_in_a_recipe(laboratory: Edit, tmp_path: Path) -> None:
    laboratory()
    from cosmic.autonomy.campaign.opening import read_recipe

    shipped = (tmp_path / "config" / "recipes" / "transport.toml").read_text(encoding="utf-8")
    recipe = tmp_path / "look.toml"
    recipe.write_text(shipped.replace('"transport"', '"look"', 1), encoding="utf-8")
    assert read_recipe(recipe).file.procedure == "look"
    recipe.write_text(shipped.replace('"transport"', '"lok"', 1), encoding="utf-8")
    with pytest.raises(cosmic.ConfigError, match=r"there is no procedure 'lok'; known: .*look"):
        read_recipe(recipe)


BROKEN = """
[cosmic.boards]
broken = no_such_package:BACKEND
[cosmic.controllers]
broken = no_such_package:BACKEND
"""


@pytest.fixture
def with_broken(tmp_path: Path, laboratory: Edit, monkeypatch: pytest.MonkeyPatch) -> Edit:
    described = tmp_path / "brokenware" / "brokenware-0.3.dist-info"
    described.mkdir(parents=True)
    (described / "METADATA").write_text("Name: brokenware\nVersion: 0.3\n", encoding="utf-8")
    (described / "entry_points.txt").write_text(BROKEN, encoding="utf-8")
    monkeypatch.syspath_prepend(str(described.parent))
    return laboratory


def test_boards_that_cannot_be_loaded_leave_the_axes_alone(with_broken: Edit) -> None:
    folder = with_broken(
        ('[daqco]\nbackend = "simulated"', '[daqco]\nbackend = "broken"'),
        (APPLICATIONS, 'applications = ["mico", "daqco"]'),
    )
    with cosmic.connect(folder, rate=1.0) as rig:
        assert rig.mico["left.x"].move_by(5.0) is not None
        with pytest.raises(cosmic.CosmicError, match=r"brokenware 0\.3.*no_such_package"):
            rig.daqco.start()


def test_a_controller_that_cannot_be_loaded_leaves_the_others_alone(
    with_broken: Edit, caplog: pytest.LogCaptureFixture
) -> None:
    folder = with_broken(
        (
            "[mico.defaults]",
            '[[mico.controller]]\nbackend = "broken"\nserials = ["B-1"]\n\n[mico.defaults]',
        ),
    )
    with cosmic.connect(folder, applications=("mico",)) as rig:
        assert rig.mico["left.x"].move_by(5.0) is not None
        assert not rig.simulated, "nobody knows what the broken one would have moved"
    assert "controller 'broken' of brokenware 0.3" in caplog.text


def test_the_only_controller_that_cannot_be_loaded_is_named(with_broken: Edit) -> None:
    folder = with_broken(('[mico]\nbackend = "simulated" ', '[mico]\nbackend = "broken" '))
    with pytest.raises(cosmic.NotConnectedError, match=r"brokenware 0\.3.*no_such_package"):
        cosmic.connect(folder, applications=("mico",))


TROUBLE = """
from cosmic.daqco.hw.interface import BoardBackend
from cosmic.daqco.hw.sim_library import SimulatedLibrary
from cosmic.frame.config import StrictModel
from cosmic.frame.errors import NotConnectedError
from cosmic.vico.hw.factory import make_camera_library
from cosmic.vico.hw.interface import CameraBackend, Frame

BROKEN = []


class Brought:
    def __init__(self, real):
        self._real = real

    def __getattr__(self, name):
        return getattr(self._real, name)

    def receive(self, timeout_s):
        if BROKEN:
            return BROKEN[0]()
        return self._real.receive(timeout_s)


class Library:
    def __init__(self, real):
        self._real = real

    def __getattr__(self, name):
        return getattr(self._real, name)

    def open(self, name):
        return Brought(self._real.open(name))


def boards(_options, context):
    return Library(SimulatedLibrary(context.clock, context.scene_sources))


def cameras(_options, context):
    real = make_camera_library("simulated", clock=context.clock, scene=context.scene)
    return PictureLibrary(real)


class PictureLibrary(Library):
    def open(self, name):
        return Pictures(self._real.open(name))


class Pictures(Brought):
    def receive(self, timeout_s):
        frame = self._real.receive(timeout_s)
        if frame is None:
            return None
        data = frame.data if not BROKEN else BROKEN[0](frame.data)
        return Frame(data, frame.frame_id, frame.time_s, frame.exposed_s)


BOARDS = BoardBackend(boards)
SIMULATED_BOARDS = BoardBackend(boards, simulated=True)
CAMERAS = CameraBackend(cameras, simulated=True)
"""


@pytest.fixture
def troublesome(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """Install a package whose board and camera do what a test says; returns its module."""
    module = f"trouble_of_{tmp_path.name.replace('-', '_')}"
    described = tmp_path / "trouble" / "troubleware-0.4.dist-info"
    described.mkdir(parents=True)
    (described.parent / f"{module}.py").write_text(TROUBLE, encoding="utf-8")
    (described / "METADATA").write_text("Name: troubleware\nVersion: 0.4\n", encoding="utf-8")
    points = (
        f"[cosmic.boards]\ntrouble = {module}:BOARDS\nslow = {module}:SIMULATED_BOARDS\n"
        f"[cosmic.cameras]\ntrouble = {module}:CAMERAS\n"
    )
    (described / "entry_points.txt").write_text(points, encoding="utf-8")
    monkeypatch.syspath_prepend(str(described.parent))
    return module


def test_a_camera_whose_images_are_not_as_it_says_is_named_and_goes_on(
    laboratory: Edit, troublesome: str
) -> None:
    folder = laboratory(
        ('title = "Microscope"\nbackend = "simulated"', 'title = "Microscope"\nbackend = "trouble"')
    )
    with cosmic.connect(folder, applications=("mico", "vico")) as rig:
        camera = rig.vico.camera()
        whole = camera.next_image(20.0).data
        broken = sys.modules[troublesome].BROKEN
        for wrong in (lambda data: data[:-8], lambda data: data.astype(float)):
            broken.append(wrong)
            assert wait_until(lambda: camera.problem)
            came = wrong(whole)
            assert f"an image of shape {came.shape}, {came.dtype}, Mono8 came" in camera.problem
            assert f"its settings say shape {whole.shape}, uint8, Mono8" in camera.problem
            assert camera.name in camera.problem
            broken.clear()
            assert wait_until(lambda: not camera.problem)
            assert camera.next_image(20.0).data.shape == whole.shape


def test_a_board_that_raises_or_gives_garbage_is_named_and_the_axes_go_on(
    laboratory: Edit, troublesome: str
) -> None:
    folder = laboratory(
        ('[daqco]\nbackend = "simulated"', '[daqco]\nbackend = "trouble"'),
        (APPLICATIONS, 'applications = ["mico", "daqco"]'),
    )

    def boom() -> None:
        raise RuntimeError("boom")

    with cosmic.connect(folder, rate=1.0) as rig:

        def acquiring() -> bool:
            try:
                return "force" in rig.daqco.latest()
            except cosmic.NotAvailable:
                return False

        broken = sys.modules[troublesome].BROKEN
        rig.daqco.disarm_limit("force")
        for what, said in (
            (boom, r"Dev\d: RuntimeError: boom"),
            (lambda: "abc", r"Dev\d: AttributeError"),
        ):
            rig.daqco.start()
            assert wait_until(acquiring)
            broken.append(what)
            assert wait_until(lambda: not rig.daqco.running)
            assert re.search(said, rig.daqco.problem)
            rig.reset_stop()  # a limit may have been armed, which nobody watched any more
            assert rig.mico["left.x"].move_by(5.0) is not None
            broken.clear()
        rig.daqco.start()
        assert wait_until(acquiring)


def test_a_board_that_hangs_is_named_and_holds_nobody_for_long(
    laboratory: Edit, troublesome: str
) -> None:
    folder = laboratory(
        ('[daqco]\nbackend = "simulated"', '[daqco]\nbackend = "slow"'),
        (APPLICATIONS, 'applications = ["mico", "daqco"]'),
    )
    with cosmic.connect(folder, rate=10.0) as rig:
        assert rig.simulated
        rig.daqco.disarm_limit("force")
        broken = sys.modules[troublesome].BROKEN
        released = threading.Event()
        broken.append(lambda: released.wait(60.0) and None)
        try:
            moved = rig.mico["left.x"].move_by(400.0, wait=False)
            began_s = WALL.now_s()
            assert moved.wait(LONGEST_HOLD_S + 6.0) is not None
            assert wait_until(lambda: not rig.daqco.running)
            assert WALL.now_s() - began_s < HANG_S + 6.0
            assert re.search(r"Dev\d: receive has not returned for 5 s", rig.daqco.problem)
            with pytest.raises(cosmic.DeviceError, match=r"Dev\d: receive still has not returned"):
                rig.daqco.start()
        finally:
            broken.clear()
            released.set()

        def acquires() -> bool:
            try:
                return "force" in rig.daqco.latest()
            except cosmic.NotAvailable:
                return False

        rig.daqco.start()
        assert wait_until(acquires)
