"""The scripted API tells of a change at once, in the thread that made it."""

import gc
import threading
from collections.abc import Callable

import pytest
from PySide6.QtCore import QCoreApplication
from typing_extensions import override

from cosmic.app.platform import build_platform
from cosmic.app.rig import Rig
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.threads import WorkerThread


class Doing(WorkerThread):
    """Does one thing in a thread of its own."""

    def __init__(self, act: Callable[[], object]) -> None:
        super().__init__("doing", FailurePolicy())
        self._act = act

    @override
    def run_body(self) -> None:
        self._act()


@pytest.mark.parametrize("hosted", ["daqco", "vico"])
def test_a_change_in_a_thread_is_reported_there_and_nothing_waits_for_one_who_is_gone(
    hosted: str, qapp: QCoreApplication
) -> None:
    platform = build_platform(applications=(hosted,))
    application = getattr(platform, hosted)
    notified_in: list[str] = []
    rig = Rig(platform)
    getattr(rig, hosted).on_change(lambda: notified_in.append(threading.current_thread().name))
    worker = Doing(application.status_changed.emit)
    worker.start()
    worker.join()
    assert len(notified_in) == 1
    assert notified_in != [threading.main_thread().name]
    rig.close()
    del rig
    gc.collect()
    QCoreApplication.sendPostedEvents()
    assert len(notified_in) == 1
