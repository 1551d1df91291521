import subprocess
import sys
from pathlib import Path

import pytest

from cosmic.frame.clock import ManualClock
from cosmic.frame.errors import NotConnectedError
from cosmic.mico.hw.factory import make_controller
from cosmic.mico.hw.interface import Channel, PositionRead
from cosmic.twin.scene import Scene
from cosmic.twin.settings import shipped_settings


def test_the_simulated_controller_moves_the_scene_it_is_given() -> None:
    scene = Scene.from_settings(shipped_settings(), ManualClock(auto_advance=True))
    controller = make_controller("simulated", scene=scene)
    assert controller.simulated
    controller.open()
    before = scene.truth()["left.x"]
    controller.report_completion(Channel(0, 0))
    controller.move_by(Channel(0, 0), 50.0, "um", hold_s=0.0)
    for _ in range(100):
        controller.receive(0, 0.1)
    assert scene.truth()["left.x"] == pytest.approx(before + 50.0, abs=1.0)
    controller.ask_position(Channel(0, 0), "um")
    event = controller.receive(0, 1.0)
    assert isinstance(event, PositionRead)
    assert event.value == pytest.approx(scene.truth()["left.x"], abs=1.0)
    controller.close()


def test_a_simulated_controller_needs_no_scene() -> None:
    assert len(make_controller("simulated").find_devices()) == 4


def test_real_hardware_is_never_replaced_by_the_simulation(tmp_path: Path) -> None:
    with pytest.raises(NotConnectedError, match=r"absent\.so"):
        make_controller("scu3d", library_path=str(tmp_path / "absent.so"))


def test_a_real_rig_does_not_load_the_simulated_library() -> None:
    code = (
        "import sys; from cosmic.mico.hw import factory;"
        "print([name for name in sys.modules if 'sim_scu3d' in name or 'PySide6' in name])"
    )
    ran = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert ran.stdout.strip() == "[]"
