"""Windows over the shipped platform, without the time that its gate's process takes to start."""

from collections.abc import Iterator, Mapping, Set
from functools import cache
from pathlib import Path
from threading import Lock

import pytest
from PySide6.QtWidgets import QApplication
from pytestqt.qtbot import QtBot
from typing_extensions import override

from cosmic.app.configuration import platform_file
from cosmic.app.windows import alarm_watch
from cosmic.daqco.api import application as daqco_application
from cosmic.mico.core.collision import collision_manager, scene_loader
from cosmic.mico.core.collision.answer import Approach, SweepAnswer
from cosmic.mico.core.collision.checker import Spans
from cosmic.mico.core.collision.clear_travel import clear_travel
from cosmic.mico.core.collision.collision_manager import Answering
from cosmic.mico.core.collision.model import BodyPair, SceneModel
from cosmic.mico.core.collision.sweep import Sweep
from gui.busy_machine import PatientQtBot


@pytest.fixture
def qtbot(qapp: QApplication, request: pytest.FixtureRequest) -> QtBot:
    """Return the robot of pytest-qt, with more patience."""
    return PatientQtBot(request)


_load_scene = cache(scene_loader.load_scene)
_sweep_of = cache(Sweep)
_lock = Lock()


class InProcess(Answering):
    """The pure gate, asked directly; one question at a time."""

    def __init__(self, model: SceneModel, **_limits: float) -> None:
        self._sweep = _sweep_of(model)

    @override
    def start(self) -> None: ...

    @override
    def close(self) -> None: ...

    @override
    def check(self, spans: Spans, ignored: Set[BodyPair] = frozenset()) -> SweepAnswer:
        with _lock:
            return self._sweep.check(spans, ignored)

    @override
    def check_promptly(
        self, spans: Spans, ignored: Set[BodyPair] = frozenset()
    ) -> SweepAnswer | None:
        return self.check(spans, ignored)

    @override
    def nearest(
        self, positions: Mapping[str, float], ignored: Set[BodyPair] = frozenset()
    ) -> Approach | None:
        with _lock:
            return self._sweep.nearest(positions, ignored)

    @override
    def clear_travel(
        self, spans: Spans, axis: str, ignored: Set[BodyPair] = frozenset()
    ) -> float | None:
        with _lock:
            return clear_travel(self._sweep, spans, axis, ignored)


def _cached(path: Path) -> SceneModel:
    """Load the shipped scene once, and any other one each time."""
    shipped = platform_file.platform_path(None).parent
    return _load_scene(path) if shipped in path.parents else _load_scene.__wrapped__(path)


@pytest.fixture(autouse=True, scope="module")
def quick_platform() -> Iterator[None]:
    """Have windows start quickly; the gate's process has tests of its own."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(collision_manager, "GateProcess", InProcess)
        patch.setattr(scene_loader, "load_scene", _cached)
        # Nothing here needs a sample as soon as it is there.
        patch.setattr(daqco_application, "LONGER", 10.0)
        # A computer that runs tests is busy; the alarm has tests of its own.
        patch.setattr(alarm_watch, "processor_load", lambda: None)
        yield
