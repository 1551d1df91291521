"""A simulated camera exposes when its trigger input rises."""

from collections.abc import Iterator
from dataclasses import replace

import pytest

from cosmic.app.configuration.platform_file import load_platform
from cosmic.app.simulation import make_scene
from cosmic.frame.clock import ManualClock
from cosmic.frame.errors import ConfigError, NotAvailable
from cosmic.twin.scene import Scene
from cosmic.vico.hw.interface import Camera, Frame, Trigger
from cosmic.vico.hw.sim_camera import SimulatedCameraLibrary


@pytest.fixture
def clock() -> ManualClock:
    return ManualClock()


@pytest.fixture
def scene(clock: ManualClock) -> Iterator[Scene]:
    file, path = load_platform(None)
    made = make_scene(file, path, clock, seed=0, cold=False, sample=None, truth=None)
    yield made
    made.close()


@pytest.fixture
def camera(scene: Scene, clock: ManualClock) -> Iterator[Camera]:
    library = SimulatedCameraLibrary(scene, clock)
    opened = library.open("Sim1")
    opened.configure(replace(opened.settings, trigger=Trigger.HARDWARE, exposure_s=0.02))
    yield opened
    library.close()


def all_of(camera: Camera) -> list[Frame]:
    frames = []
    while (frame := camera.receive(0.0)) is not None:
        frames.append(frame)
    return frames


def test_an_exposure_begins_when_the_line_rises(
    camera: Camera, scene: Scene, clock: ManualClock
) -> None:
    camera.start()
    clock.advance(1.0)
    assert not all_of(camera)
    scene.trigger_lines["Dev1/ctr0"].drive(1.25, 0.1)
    clock.advance(0.65)
    frames = all_of(camera)
    assert [each.exposed_s for each in frames] == pytest.approx([1.25, 1.35, 1.45, 1.55])
    assert [each.frame_id for each in frames] == [0, 1, 2, 3]


def test_an_edge_that_comes_while_it_exposes_is_not_heard(
    camera: Camera, scene: Scene, clock: ManualClock
) -> None:
    camera.configure(replace(camera.settings, exposure_s=0.15, rate_hz=5.0))
    camera.start()
    scene.trigger_lines["Dev1/ctr0"].drive(0.0, 0.1)
    clock.advance(0.9)
    assert [each.exposed_s for each in all_of(camera)] == pytest.approx([0.0, 0.2, 0.4, 0.6])


def test_edges_before_the_start_are_not_heard(
    camera: Camera, scene: Scene, clock: ManualClock
) -> None:
    scene.trigger_lines["Dev1/ctr0"].drive(0.0, 0.1)
    clock.advance(1.05)
    camera.start()
    clock.advance(0.15)
    assert [each.exposed_s for each in all_of(camera)] == pytest.approx([1.1])


def test_with_the_hardware_trigger_there_is_none_by_software(camera: Camera) -> None:
    camera.start()
    with pytest.raises(NotAvailable, match="hardware"):
        camera.trigger()


def test_a_camera_without_a_wire_has_no_hardware_trigger(scene: Scene, clock: ManualClock) -> None:
    library = SimulatedCameraLibrary(scene, clock)
    overview = library.open("Sim2")
    assert Trigger.HARDWARE not in overview.ranges.triggers
    with pytest.raises(ConfigError):
        overview.configure(replace(overview.settings, trigger=Trigger.HARDWARE))
    library.close()
