"""Images drawn in a process of their own are the same images, also when that process fails."""

import gc
import os
import signal
import subprocess
from collections.abc import Iterator
from threading import Thread

import numpy as np
import pytest

from cosmic.frame.clock import WALL, ManualClock
from cosmic.twin.optics.drawing import LIMIT_S, MODULE, Drawing, DrawingProcess, RemoteDrawer
from cosmic.twin.optics.optics import Optics
from cosmic.twin.scene import Scene
from cosmic.twin.settings import shipped_settings


@pytest.fixture
def process() -> Iterator[DrawingProcess]:
    made = DrawingProcess()
    yield made
    made.end()


def make_optics(process: DrawingProcess | None, monkeypatch: pytest.MonkeyPatch) -> Optics:
    if process is not None:
        monkeypatch.setattr("cosmic.twin.optics.optics.drawing_process", lambda: process)
    scene = Scene.from_settings(shipped_settings(), ManualClock(), 3, apart=process is not None)
    assert scene.optics is not None
    return scene.optics


def pid_of_helper() -> int:
    found = subprocess.run(
        ["pgrep", "-n", "-P", str(os.getpid()), "-f", MODULE],
        capture_output=True,
        text=True,
        check=True,
    )
    return int(found.stdout)


def wait_until_ready(drawing: Drawing) -> None:
    end_s = WALL.now_s() + 20.0
    while not drawing.ready:
        assert WALL.now_s() < end_s
        WALL.sleep(0.01)


@pytest.mark.parametrize("view", ["microscope", "overview"])
def test_it_is_the_same_image_wherever_it_is_drawn(
    process: DrawingProcess, monkeypatch: pytest.MonkeyPatch, view: str
) -> None:
    here, apart = make_optics(None, monkeypatch), make_optics(process, monkeypatch)
    for at_s in (1.0, 2.0):  # the second time what lies on the plate is known there
        for bits in (8, 16):
            expected = here.render(at_s, bits=bits, view=view)
            found = apart.render(at_s, bits=bits, view=view)
            assert found.dtype == expected.dtype
            assert np.array_equal(found, expected)


def test_an_image_can_be_asked_for_and_fetched_later(
    process: DrawingProcess, monkeypatch: pytest.MonkeyPatch
) -> None:
    optics = make_optics(process, monkeypatch)
    drawings = [optics.expose(at_s) for at_s in (1.0, 2.0, 3.0)]
    for drawing in drawings:
        wait_until_ready(drawing)
    newest_first = [drawing.pixels() for drawing in reversed(drawings)]
    assert len({image.tobytes() for image in newest_first}) == 3


def test_a_process_that_is_killed_is_replaced_and_no_image_is_lost(
    process: DrawingProcess, monkeypatch: pytest.MonkeyPatch
) -> None:
    optics = make_optics(process, monkeypatch)
    expected = optics.render(1.0)
    killed = pid_of_helper()
    drawing = optics.expose(1.0)
    os.kill(killed, signal.SIGKILL)
    assert np.array_equal(drawing.pixels(), expected)
    assert np.array_equal(optics.render(1.0), expected)
    assert np.array_equal(optics.render(1.0), expected)
    assert pid_of_helper() != killed


def test_a_process_that_cannot_stay_up_costs_no_image(
    process: DrawingProcess, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("cosmic.twin.optics.drawing.MODULE", "cosmic.no_such_module")
    optics = make_optics(process, monkeypatch)
    for _ in range(5):
        assert optics.render(1.0).shape


def test_images_abandoned_half_way_do_not_block_the_next(
    process: DrawingProcess, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    optics = make_optics(process, monkeypatch)
    begun_s = WALL.now_s()
    for number in range(30):  # most of them while the process comes up
        optics.expose(1.0 + number)
    gc.collect()
    assert optics.render(40.0).shape
    assert WALL.now_s() - begun_s < 0.5 * LIMIT_S
    assert not caplog.records, "the process was given up"


def test_threads_that_ask_at_once_get_each_its_own_image(
    process: DrawingProcess, monkeypatch: pytest.MonkeyPatch
) -> None:
    optics = make_optics(process, monkeypatch)
    expected = {at_s: optics.render(at_s).tobytes() for at_s in (1.0, 2.0, 3.0, 4.0)}
    found: dict[float, list[bytes]] = {at_s: [] for at_s in expected}

    def look(at_s: float) -> None:
        for _ in range(5):
            found[at_s].append(optics.render(at_s).tobytes())

    threads = [Thread(target=look, args=(at_s,)) for at_s in expected]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(60.0)
    assert found == {at_s: [image] * 5 for at_s, image in expected.items()}


def test_views_that_nobody_needs_are_dropped_there_too(process: DrawingProcess) -> None:
    settings = shipped_settings().optics
    drawer = RemoteDrawer(process, settings, 0)
    assert not process.dropped
    del drawer
    gc.collect()
    assert len(process.dropped) == 1


def test_a_closed_scene_lets_go_of_its_views_and_can_still_be_drawn(
    process: DrawingProcess, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("cosmic.twin.optics.optics.drawing_process", lambda: process)
    scene = Scene.from_settings(shipped_settings(), ManualClock(), 3, apart=True)
    assert scene.optics is not None
    before = scene.optics.render(1.0)
    assert not process.dropped

    scene.close()
    scene.close()

    assert len(process.dropped) == 1, "although somebody still knows of it"
    np.testing.assert_array_equal(scene.optics.render(1.0), before)
