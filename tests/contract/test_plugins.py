"""What other packages bring is found by name, and what ships with CoSMic by the same door."""

import subprocess
import sys
import textwrap
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import pytest

import cosmic
from cosmic.app.cli import main
from cosmic.frame.config import StrictModel
from cosmic.frame.errors import ConfigError
from cosmic.frame.plugins import (
    Backend,
    Kind,
    Plugin,
    find_backend,
    make,
    names,
    plugins,
    read_options,
)
from cosmic.vico.hw.factory import make_camera_library

SHIPPED = [each for kind in Kind for each in plugins(kind) if each.package.startswith("cosmic ")]

Write = Callable[..., str]


@pytest.fixture
def write_package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Write]:
    """Write and install a package of somebody else; returns the name of its module."""
    find_backend.cache_clear()
    made: list[str] = []

    def write(name: str, points: str, code: str) -> str:
        folder = tmp_path / name
        module = f"{name}_of_{tmp_path.name}"
        (folder / f"{name}-1.2.dist-info").mkdir(parents=True)
        (folder / f"{module}.py").write_text(textwrap.dedent(code), encoding="utf-8")
        described = folder / f"{name}-1.2.dist-info"
        (described / "METADATA").write_text(f"Name: {name}\nVersion: 1.2\n", encoding="utf-8")
        (described / "entry_points.txt").write_text(points.format(module), encoding="utf-8")
        monkeypatch.syspath_prepend(str(folder))
        made.append(module)
        return module

    yield write
    find_backend.cache_clear()
    for module in made:
        sys.modules.pop(module, None)


BOARD = """
    from cosmic.daqco.hw.interface import BoardBackend
    from cosmic.daqco.hw.sim_library import SimulatedLibrary
    from cosmic.frame.config import StrictModel

    class Options(StrictModel):
        boards: int

    class OurLibrary(SimulatedLibrary):
        @property
        def name(self):
            return "Our boards"

    def make(options, context):
        return OurLibrary(context.clock, context.scene_sources, boards=options.boards)

    BACKEND = BoardBackend(make, options=Options)
"""
POINTS = "[cosmic.boards]\nour_board = {}:BACKEND\n"


@pytest.mark.parametrize("plugin", SHIPPED, ids=lambda each: f"{each.kind.value}:{each.name}")
def test_what_is_shipped_loads_and_refuses_options_that_it_has_not(plugin: Plugin) -> None:
    assert isinstance(find_backend(plugin.kind, plugin.name), Backend)
    with pytest.raises(ConfigError, match="no_such_option: unknown key"):
        read_options(plugin.kind, plugin.name, {"no_such_option": 1})


def test_the_shipped_boards_are_there() -> None:
    assert {"labjack", "nidaqmx", "simulated"} <= set(names(Kind.BOARD))


def test_the_shipped_cameras_are_there() -> None:
    shipped = {"aravis", "dc1394", "harvesters", "opencv", "simulated"}
    assert shipped <= set(names(Kind.CAMERA))


def test_an_outside_package_is_found_and_makes_what_its_options_say(write_package: Write) -> None:
    module = write_package("labware", POINTS, BOARD)
    assert "our_board" in names(Kind.BOARD)
    assert module not in sys.modules, "it is loaded when it is named, not before"
    from cosmic.daqco.hw.interface import BoardContext
    from cosmic.frame.clock import ManualClock

    library = make(Kind.BOARD, "our_board", BoardContext(ManualClock()), {"boards": 5})
    assert len(library.list_boards()) == 5
    with pytest.raises(ConfigError, match="boards: key is missing"):
        read_options(Kind.BOARD, "our_board")
    with pytest.raises(ConfigError, match=r"boards: .*the file has 'two'"):
        read_options(Kind.BOARD, "our_board", {"boards": "two"})


@pytest.fixture
def laboratory(tmp_path: Path, write_package: Write, capsys: pytest.CaptureFixture[str]) -> Path:
    """A platform whose boards an outside package drives."""
    write_package("labware", POINTS, BOARD)
    folder = tmp_path / "config"
    assert main(["init", str(folder)]) == 0
    edit(folder, '[daqco]\nbackend = "simulated"', '[daqco]\nbackend = "our_board"')
    edit(folder, "[[daqco.scale]]", "[daqco.options]\nboards = 2\n\n[[daqco.scale]]")
    capsys.readouterr()
    return folder


def edit(folder: Path, old: str, new: str) -> None:
    file = folder / "platform.toml"
    text = file.read_text(encoding="utf-8")
    assert old in text
    file.write_text(text.replace(old, new, 1), encoding="utf-8")


def test_its_board_acquires_on_a_platform_that_names_it(laboratory: Path) -> None:
    assert main(["check", str(laboratory)]) == 0
    with cosmic.connect(laboratory, applications=("daqco",)) as rig:
        assert rig.daqco.settings.backend == "our_board"
        rig.daqco.start()
        assert "force" in rig.daqco.latest()


def test_a_check_names_file_and_option(
    laboratory: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    edit(laboratory, "boards = 2", "bords = 2")
    assert main(["check", str(laboratory)]) == 1
    said = capsys.readouterr().err
    assert (
        f"{laboratory / 'platform.toml'}: daqco: options of acquisition board 'our_board': bords"
        in said
    )
    edit(laboratory, '"our_board"', '"their_board"')
    assert main(["check", str(laboratory)]) == 1
    said = capsys.readouterr().err
    assert "no acquisition board 'their_board'" in said
    assert "our_board (labware 1.2)" in said
    assert "Did you mean 'our_board'?" in said


CAMERA = """
    from cosmic.frame.config import StrictModel
    from cosmic.vico.hw.interface import CameraBackend
    from cosmic.vico.hw.opencv import OpenCvLibrary

    class Options(StrictModel):
        film: str

    def make(options, context):
        return OpenCvLibrary(context.clock, sources=[options.film])

    BACKEND = CameraBackend(make, options=Options)
"""


def test_its_camera_is_named_in_a_platform_file_with_its_options(
    tmp_path: Path, write_package: Write, capsys: pytest.CaptureFixture[str]
) -> None:
    write_package("filmware", "[cosmic.cameras]\nour_camera = {}:BACKEND\n", CAMERA)
    folder = tmp_path / "config"
    assert main(["init", str(folder)]) == 0
    camera = '[[vico.camera]]\nname = "film"\nbackend = "our_camera"\n\n[[vico.camera]]'
    edit(
        folder,
        "[[vico.camera]]",
        f"[vico.options.our_camera]\nfilm = 'http://127.0.0.1:9/none'\n\n{camera}",
    )
    assert main(["check", str(folder)]) == 0
    edit(folder, "film = 'http://127.0.0.1:9/none'", "fim = 'a'")
    capsys.readouterr()
    assert main(["check", str(folder)]) == 1
    said = capsys.readouterr().err
    assert "vico: options of camera 'our_camera': film: key is missing" in said
    with closing(
        make_camera_library("our_camera", options={"film": "http://127.0.0.1:9/none"})
    ) as library:
        assert [each.key for each in library.cameras()][:1] == ["http://127.0.0.1:9/none"]


def test_two_packages_with_one_name_are_refused(write_package: Write) -> None:
    write_package("labware", POINTS, BOARD)
    write_package("otherware", POINTS, BOARD)
    with pytest.raises(ConfigError, match=r"labware 1\.2 and otherware 1\.2"):
        find_backend(Kind.BOARD, "our_board")


def test_nobody_replaces_what_is_shipped(write_package: Write) -> None:
    write_package("labware", "[cosmic.boards]\nsimulated = {}:BACKEND\n", BOARD)
    with pytest.raises(ConfigError, match=r"cosmic \S+ and labware 1\.2"):
        find_backend(Kind.BOARD, "simulated")


@pytest.mark.parametrize(
    ("code", "reason"),
    [
        ("import no_such_vendor\n", "ModuleNotFoundError.*no_such_vendor"),
        ("1 / 0\n", "ZeroDivisionError"),
        ("OTHER = 1\n", "BACKEND"),
        ("BACKEND = 'boards'\n", "not a cosmic Backend but a str"),
    ],
)
def test_a_package_that_is_broken_is_named(write_package: Write, code: str, reason: str) -> None:
    write_package("labware", POINTS, code)
    with pytest.raises(ConfigError, match=rf"(?s)labware 1\.2.*{reason}"):
        find_backend(Kind.BOARD, "our_board")


def test_without_options_a_backend_has_none() -> None:
    class Product:
        pass

    backend: Backend[None, Product] = Backend(lambda _options, _context: Product())
    assert issubclass(backend.options, StrictModel)
    assert not backend.options.model_fields


def test_names_are_known_without_loading_anything() -> None:
    code = (
        "import sys; from cosmic.frame.plugins import Kind, names; names(Kind.BOARD); "
        "sys.exit('nidaqmx' in sys.modules or 'cosmic.daqco' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False, timeout=60).returncode == 0
