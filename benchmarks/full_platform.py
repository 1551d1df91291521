"""Everything at once in one process: MiCo, DAQCo recording, ViCo live, a campaign, a window.

A stop ends a campaign. So that two thousand stops meet one, the campaign runs on a second simulated
platform in the same process: more threads of Python than any real platform has, on one interpreter.
"""

import ctypes
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from threading import get_native_id
from typing import Any
from unittest.mock import patch

from PySide6.QtCore import QEvent, QSettings, QTimer
from typing_extensions import override

import cosmic
from benchmarks.stand import REPAINT_MS, Stand, application, wait_until
from benchmarks.traced import TracedLibrary
from cosmic.app.platform import Platform, build_platform
from cosmic.app.rig import Rig
from cosmic.app.windows.operator_window import OperatorWindow
from cosmic.autonomy.campaign.campaign import Campaign
from cosmic.daqco.gui.main_widget import make_daqco_gui
from cosmic.frame.log import RingBufferHandler, set_up_logging
from cosmic.frame.threads import declare_gui_thread
from cosmic.mico.gui.mico_widget import make_mico_gui
from cosmic.mico.hw import sim_controllers
from cosmic.vico.gui.vico_gui import make_vico_gui

SAMPLE, RECIPE = "forty-dry", "bend-test"
BUSY = "while True:\n    pass\n"


@dataclass
class FullStand(Stand):
    """The running platform; `campaign` is the one beside it, if any."""

    platform: Platform
    rig: Rig
    campaign: Campaign | None
    recording: Path

    @override
    def wait_until_ready(self) -> None:
        """Wait until every axis is there, and let the instruments run and record."""
        super().wait_until_ready()
        self.rig.daqco.start()
        self.rig.daqco.start_recording(self.recording)
        camera = self.rig.vico.camera()
        camera.start().wait(20.0)
        wait_until(lambda: camera.latest is not None, 20.0)


@contextmanager
def full_platform(
    *, campaign: bool = True, repainted: bool = True, seed: int = 1
) -> Iterator[FullStand]:
    """Set up the shipped platform with its whole window, recording and with its camera live.

    The panels of the axes are painted all the time unless `repainted` is False.
    """
    app = application()
    load = sim_controllers.load_simulated_scu3d
    traced: list[Any] = []

    def traced_library(**more: Any) -> TracedLibrary:
        traced.append(TracedLibrary(load(**more)))
        return traced[-1]

    with ExitStack() as at_end:
        folder = Path(at_end.enter_context(tempfile.TemporaryDirectory()))
        ring = RingBufferHandler()
        at_end.callback(set_up_logging(ring, file=folder / "cosmic.log"))
        beside = at_end.enter_context(_campaign(folder, seed)) if campaign else None
        with patch.object(sim_controllers, "load_simulated_scu3d", traced_library):
            platform = build_platform(
                sample=SAMPLE,
                seed=seed,
                mico_gui=make_mico_gui,
                daqco_gui=make_daqco_gui,
                vico_gui=make_vico_gui,
            )
        at_end.callback(platform.shut_down)
        at_end.callback(declare_gui_thread())
        settings = QSettings(str(folder / "window.ini"), QSettings.Format.IniFormat)
        window = OperatorWindow(platform, settings, ring)
        at_end.callback(app.sendPostedEvents, None, QEvent.Type.DeferredDelete.value)
        at_end.callback(window.deleteLater)
        at_end.callback(window.close_now)
        window.show()
        window.resize(1600, 1000)
        rig = Rig(platform, "benchmark")
        window.open_hardware()
        timer = QTimer(window, interval=REPAINT_MS)
        if repainted and window.mico_gui is not None:
            timer.timeout.connect(window.mico_gui.update)
            timer.start()
        yield FullStand(
            app, window, rig.mico, traced[-1], platform, rig, beside, folder / "recording.h5"
        )


@contextmanager
def _campaign(folder: Path, seed: int) -> Iterator[Campaign]:
    with cosmic.connect(sample=SAMPLE, seed=seed) as rig:
        campaign = rig.campaign(RECIPE, folder / "campaign")
        campaign.start()
        try:
            yield campaign
        finally:
            campaign.abort()
            campaign.join()


@contextmanager
def busy_processes(count: int) -> Iterator[None]:
    """Load the computer with so many other programs that never wait."""
    busy = [subprocess.Popen([sys.executable, "-c", BUSY]) for _ in range(count)]
    try:
        yield
    finally:
        for each in busy:
            each.kill()
            each.wait()


class CoreWait:
    """How long the thread that made it was ready to run and had no core; 0 off Linux.

    It is read without letting go of the interpreter, so that reading adds no wait of its own.
    """

    def __init__(self) -> None:
        self._file = -1
        with suppress(OSError):
            self._file = os.open(f"/proc/self/task/{get_native_id()}/schedstat", os.O_RDONLY)
            self._pread = ctypes.PyDLL(None).pread
            self._text = ctypes.create_string_buffer(100)

    def now_s(self) -> float:
        """Return its wait since it was started."""
        if self._file < 0:
            return 0.0
        self._pread(self._file, self._text, 99, ctypes.c_long(0))
        return int(self._text.value.split()[1]) / 1e9

    def close(self) -> None:
        """Read no more."""
        if self._file >= 0:
            os.close(self._file)
            self._file = -1
