"""The shipped platform with the simulated library in reach, so that tests can break it."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from cosmic.app.configuration.platform_file import load_platform, load_twin
from cosmic.frame.clock import WALL, RatedClock
from cosmic.frame.failure import FailurePolicy
from cosmic.mico.api.application import MicoApplication
from cosmic.mico.api.mico import Mico
from cosmic.mico.hw.scu3d import Scu3dController
from cosmic.mico.hw.sim_scu3d import load_simulated_library
from cosmic.twin.scene import Scene


@contextmanager
def platform(
    rate: float = 20.0, *, cold: bool = False, **changes: Any
) -> Iterator[tuple[Mico, Any, Scene]]:
    file, path = load_platform(None)
    clock = RatedClock(rate)
    scene = Scene.from_settings(load_twin(file, path), clock, seed=1, cold=cold)
    library = load_simulated_library(scene=scene)
    controller = Scu3dController(library, simulated=True)
    settings = file.mico.model_copy(update=changes)
    application = MicoApplication(controller, settings, clock=clock, policy=FailurePolicy())
    before = changes.pop("before", None)
    if before:
        before(library)
    application.initialize()
    try:
        yield Mico(application), library, scene
    finally:
        library.faults.clear()
        application.shut_down()


def wait_until(condition: Any, timeout_s: float = 20.0) -> None:
    end = WALL.now_s() + timeout_s
    while not condition():
        assert WALL.now_s() < end, "it did not happen"
        WALL.sleep(0.005)
