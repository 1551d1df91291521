"""The workspace Results: the list of sessions beside the viewer of what is chosen in it."""

import csv
import logging
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Final

import numpy as np
from pyqtgraph.functions import arrayToQPolygonF
from PySide6.QtCore import Qt, QTimer
from PySide6.QtGui import QColor, QHideEvent, QImage, QPen, QShowEvent
from PySide6.QtWidgets import (
    QHBoxLayout,
    QSplitter,
    QStackedWidget,
    QVBoxLayout,
    QWidget,
)

from cosmic.app.panels.results.campaign_page import CampaignPage
from cosmic.app.panels.results.pictures import still_pixels
from cosmic.app.panels.results.session_list import THUMBNAIL, SessionList
from cosmic.app.panels.results.viewer import ResultViewer
from cosmic.app.results.sessions import SEEN, Item, ItemKind, read_about
from cosmic.app.results.timeline import Timeline, load_timeline
from cosmic.autonomy.campaign.records import CampaignError
from cosmic.autonomy.campaign.storage_format import DATABASE, FIBRES
from cosmic.daqco.api.recording import open_recording
from cosmic.frame.background import BackgroundJobs
from cosmic.frame.errors import CosmicError, RecordingError
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.gui.beside import open_with_desktop
from cosmic.frame.gui.build import named
from cosmic.frame.gui.elided_label import ElidedLabel
from cosmic.frame.gui.painting import painting
from cosmic.frame.gui.palette import OKABE_ITO
from cosmic.frame.gui.relay import Relay
from cosmic.frame.gui.theme import STEP_PX
from cosmic.frame.overrides import override
from cosmic.mico.core.collision.model import SceneModel
from cosmic.vico.core.recording.reading import open_image_recording

logger = logging.getLogger(__name__)

MOST_COMPARED: Final = 6
FOLLOW_MS: Final = 1000
LIST_PX: Final = 34 * STEP_PX
_THUMBNAIL_SAMPLES: Final = 2000
REPORT: Final = "report.html"


class ResultsPanel(QWidget):
    """Sessions at the left, what is chosen at the right; GUI thread.

    Parameters
    ----------
    folders : callable
        Returns where recordings are looked for.
    policy : FailurePolicy
        Hears of defects while something is read.
    model : callable
        Returns the bodies of the platform; None without any.
    """

    def __init__(
        self,
        folders: Callable[[], Sequence[Path]],
        policy: FailurePolicy,
        model: Callable[[], SceneModel | None],
        parent: QWidget | None = None,
    ) -> None:
        super().__init__(parent)
        self.setObjectName("resultsPanel")
        self._jobs = BackgroundJobs("results", policy)
        self._asked: tuple[Item, ...] = ()
        self._being_read: tuple[Item, ...] = ()
        self._loading = False
        self._state = (0, 0)
        self._loaded = Relay(self._on_loaded)
        self._reported = Relay(self._on_report)
        self.sessions = SessionList(folders, self._jobs, thumbnail_of)
        self.sessions.chosen.connect(self._on_chosen)
        self.sessions.again.clicked.connect(self._read_campaign)
        self.viewer = ResultViewer(self._jobs, model)
        self.viewer.export_requested.connect(self.export)
        self.viewer.report_requested.connect(self.open_recording_report)
        self.message = named(ElidedLabel(), "resultsMessage")
        self.message.clicked.connect(self._open_written)
        self._written: Path | None = None
        self.campaign = CampaignPage(self._jobs)
        self.campaign.report_requested.connect(self.open_report)
        self.campaign.failed.connect(self.message.set_text)
        self.open_file: Callable[[Path], object] = open_with_desktop
        self._arrange()
        self._follow = QTimer(self, interval=FOLLOW_MS)
        self._follow.timeout.connect(self._on_follow)

    def _arrange(self) -> None:
        self.pages = QStackedWidget()
        self.pages.addWidget(self.viewer)
        self.pages.addWidget(self.campaign)
        right = QWidget()
        column = QVBoxLayout(right)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(STEP_PX // 2)
        column.addWidget(self.pages, 1)
        column.addWidget(self.message)
        split = QSplitter(Qt.Orientation.Horizontal)
        split.setChildrenCollapsible(False)
        split.addWidget(self.sessions)
        split.addWidget(right)
        split.setStretchFactor(1, 1)
        split.setSizes([LIST_PX, 4 * LIST_PX])
        whole = QHBoxLayout(self)
        whole.setContentsMargins(STEP_PX, STEP_PX // 2, STEP_PX, STEP_PX // 2)
        whole.addWidget(split)

    # Choosing and showing

    def refresh(self) -> None:
        """Look for recordings again; returns at once."""
        self.sessions.refresh()
        self._read_campaign()

    def show_file(self, file: Path) -> None:
        """Choose a recording, as soon as it is listed."""
        self.sessions.show_file(file)

    def _on_chosen(self, items: tuple[Item, ...]) -> None:
        self.message.set_text("")
        self._written = None
        campaign = bool(items) and items[0].kind is ItemKind.CAMPAIGN
        self.pages.setCurrentIndex(1 if campaign else 0)
        if campaign:
            self._asked = items[:1]
            self._read_campaign()
            return
        self._asked = tuple(e for e in items if e.kind is not ItemKind.CAMPAIGN)[:MOST_COMPARED]
        self._load()

    def _read_campaign(self) -> None:
        if self._asked and self._asked[0].kind is ItemKind.CAMPAIGN:
            self.campaign.show_campaign(self._asked[0].path)

    def _load(self) -> None:
        """Have what is chosen read; while something is read, only the newest choice waits."""
        asked = self._asked
        if self._loading or (asked and asked[0].kind is ItemKind.CAMPAIGN):
            return
        if not asked:
            self.viewer.show_timelines(())
            return
        self._loading = True
        self._being_read = asked
        self._state = _state_of(asked[0])
        beside = [each for session in self.sessions.sessions for each in session.items]

        def load() -> list[Timeline]:
            first = load_timeline(asked[0], beside)
            return [first, *(load_timeline(each) for each in asked[1:])]

        self._jobs.do(load, self._loaded)

    def _on_loaded(self, timelines: list[Timeline] | None, error: CosmicError | None) -> None:
        self._loading = False
        if self._being_read != self._asked:  # others were chosen meanwhile
            self._load()
        elif timelines is not None:
            self.viewer.show_timelines(timelines)
        else:
            self.viewer.show_timelines(())
            self.message.set_text(f"It cannot be shown: {error}")

    def _on_follow(self) -> None:
        """Show what was added to a recording that is still written."""
        shown = self.viewer.timelines
        if not shown or shown[0].complete or self._loading or not self._asked:
            return
        if _state_of(self._asked[0]) != self._state:
            self._load()

    @override
    def showEvent(self, event: QShowEvent) -> None:
        super().showEvent(event)
        self._follow.start()

    @override
    def hideEvent(self, event: QHideEvent) -> None:
        super().hideEvent(event)
        self._follow.stop()

    # Writing what is seen, and reports

    def export(self) -> None:
        """Write an image of the viewer, and the values between the cursors, beside the record."""
        path = self.viewer.path
        if path is None:
            return
        base = free_base(path.parent, f"{path.stem}{SEEN}")
        picture = base.with_name(f"{base.name}.png")  # a name may have full stops of its own
        try:
            if not self.viewer.grab().save(str(picture)):
                raise OSError(f"{picture} cannot be written")
            values = self.viewer.between_cursors()
            if values:
                write_values(base.with_name(f"{base.name}_values.csv"), values, self.viewer)
        except OSError as exc:
            self.message.set_text(f"Not written: {exc}")
            return
        self._written = picture
        also = f" and {base.name}_values.csv" if values else ""
        self.message.set_text(f"written: {self._written}{also}")

    def _open_written(self) -> None:
        if self._written is not None:
            self.open_file(self._written)

    def open_report(self) -> None:
        """Open the report of the campaign that is chosen; it is written first if need be."""
        if not self._asked:
            return
        folder = self._asked[0].path
        self.message.set_text("writing the report")

        def report() -> Path:
            # Imported here: reports load statistics.
            from cosmic.autonomy.campaign.report import write_report
            from cosmic.autonomy.campaign.store_read import CampaignReader

            page = folder / REPORT
            try:
                if not page.exists() or is_older(page, folder / DATABASE):
                    write_report(CampaignReader(folder), page)
            except OSError as exc:
                raise CampaignError(f"{page} cannot be written: {exc}") from exc
            return page

        self._jobs.do(report, self._reported)

    def open_recording_report(self) -> None:
        """Write the report of the recording that is shown beside it, and open it."""
        shown = self.viewer.timelines
        if not shown:
            return
        self.message.set_text("writing the report")

        def report() -> Path:
            # Imported here: reports load statistics.
            from cosmic.app.results.recording_report import report_path, write_recording_report

            page = report_path(shown[0].path)
            write_recording_report(shown[0], read_about(shown[0].path.parent), page)
            return page

        self._jobs.do(report, self._reported)

    def _on_report(self, page: Path | None, error: CosmicError | None) -> None:
        if page is None:
            self.message.set_text(f"No report: {error}")
            return
        self._written = page
        self.message.set_text(f"opened: {page}")
        self.open_file(page)

    def shut_down(self) -> None:
        """End what is read; before the window goes."""
        self._follow.stop()
        self._jobs.request_end()
        self._jobs.join()
        self.viewer.pictures.release()


def free_base(folder: Path, base: str) -> Path:
    """Return a path, without ending, of which no image and no table is there yet."""
    number, name = 1, base
    while any((folder / f"{name}{each}").exists() for each in (".png", "_values.csv")):
        number += 1
        name = f"{base}_{number}"
    return folder / name


def write_values(
    path: Path, curves: Sequence[tuple[str, np.ndarray, np.ndarray]], viewer: ResultViewer
) -> None:
    """Write what lies between the cursors as a table; raises `OSError`."""
    unit = viewer.curves.unit
    over = viewer.curves.across
    with path.open("w", newline="", encoding="utf-8") as file:
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(["recording", "time_s" if over == "time" else over, f"force, {unit}"])
        for name, where, what in curves:
            rows.writerows((name, f"{x:.6g}", f"{y:.6g}") for x, y in zip(where, what, strict=True))


def is_older(file: Path, other: Path) -> bool:
    """Tell whether a file was written before another; raises `OSError`."""
    return file.stat().st_mtime_ns < other.stat().st_mtime_ns


def _state_of(item: Item) -> tuple[int, int]:
    """Return what changes when somebody writes to it."""
    try:
        facts = item.path.stat()
    except OSError:
        return 0, 0
    return facts.st_size, facts.st_mtime_ns


# Thumbnails


def thumbnail_of(item: Item) -> QImage | None:
    """Return a small image of an item: its curve, or the image in its middle; any thread."""
    try:
        if item.kind is ItemKind.FORCE:
            return _curve_image(item.path)
        if item.kind is ItemKind.IMAGES:
            with open_image_recording(item.path) as images:
                return _scaled(images[len(images) // 2].data) if len(images) else None
        if item.kind is ItemKind.IMAGE:
            return _still_image(item.path)
        if item.kind is ItemKind.CAMPAIGN:  # the first fibre that was seen
            return _still_image(min((item.path / FIBRES).glob("*.png")))
    except (CosmicError, OSError, IndexError, ValueError, StopIteration) as exc:
        logger.debug("%s has no thumbnail: %s", item.path, exc)
    return None


def _still_image(path: Path) -> QImage:
    from cosmic.vico.core.measuring.image_files import read_images

    return _scaled(still_pixels(next(iter(read_images(path))).pixels))


def _curve_image(path: Path) -> QImage:
    with open_recording(path) as recording:
        if not recording.samples:
            raise RecordingError(f"{path} has no samples")
        channel = recording.channels[0]
        step = max(1, recording.samples // _THUMBNAIL_SAMPLES)
        if recording.samples <= 50 * _THUMBNAIL_SAMPLES:
            values = recording.values(channel)[::step]
        else:  # a glance at a long one, not all of it
            rows = [recording.block(k, k + 1)[1] for k in range(0, recording.samples, 20 * step)]
            values = np.concatenate(rows)
    low, high = float(np.min(values)), float(np.max(values))
    width, height = THUMBNAIL.width(), THUMBNAIL.height()
    across = np.linspace(1.0, width - 2.0, values.size)
    up = height - 3.0 - (height - 6.0) * (values - low) / max(high - low, 1e-9)
    image = QImage(THUMBNAIL, QImage.Format.Format_ARGB32_Premultiplied)
    image.fill(Qt.GlobalColor.transparent)
    with painting(image) as painter:
        painter.setPen(QPen(QColor(OKABE_ITO["orange"]), 1.2))
        # All points at once: hundreds of Qt's objects, made while another thread collects garbage,
        # have ended the process.
        painter.drawPolyline(arrayToQPolygonF(across, up))
    return image


def _scaled(pixels: np.ndarray) -> QImage:
    grey = pixels if pixels.ndim == 2 else pixels[..., :3].mean(axis=2)
    step = max(1, grey.shape[1] // (2 * THUMBNAIL.width()))
    small = np.ascontiguousarray(grey[::step, ::step], dtype=float)
    top = float(small.max()) or 1.0
    coded = np.ascontiguousarray(255.0 * small / top).astype(np.uint8)
    height, width = coded.shape
    image = QImage(coded.tobytes(), width, height, width, QImage.Format.Format_Grayscale8)
    return image.scaled(
        THUMBNAIL,
        Qt.AspectRatioMode.KeepAspectRatio,
        Qt.TransformationMode.SmoothTransformation,
    ).copy()
