"""Results: finding what was recorded, and looking at force, positions, images and log together."""

import base64
import math
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pyqtgraph as pg
import pytest
import tifffile
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QApplication, QGraphicsTextItem
from pytestqt.qtbot import QtBot

from cosmic.app.panels.results.panel import ResultsPanel
from cosmic.app.results.recording_report import write_recording_report
from cosmic.app.results.sessions import (
    About,
    SessionFolder,
    read_about,
    sessions_in,
    write_about,
)
from cosmic.app.results.timeline import Timeline, Track, load_timeline
from cosmic.daqco.core.chunk import DataChunk
from cosmic.daqco.core.recording_file import RecordingFile
from cosmic.daqco.core.recording_format import AxisPosition, RecordedEvent, RecordingHeader
from cosmic.daqco.core.scale import Scale
from cosmic.daqco.core.settings import ChannelSettings
from cosmic.frame.failure import FailurePolicy
from cosmic.frame.gui.amounts import size_text
from cosmic.frame.gui.palette import DARK, LIGHT, blend, contrast_ratio
from cosmic.frame.gui.theme import apply_theme, current_palette
from cosmic.vico.core.image import CameraImage, Circumstances
from cosmic.vico.core.recording.formats import ImageFormat
from cosmic.vico.core.recording.image_file import ImageFile
from cosmic.vico.core.recording.side_row import row_of
from cosmic.vico.hw.interface import Frame, PixelFormat
from gui.app.test_workspaces import clipped, overlapping

LEFT = Qt.MouseButton.LeftButton
RATE_HZ = 1000.0
"""Of the samples; the force rises by `SLOPE` from second to second, and by as much per um."""
SLOPE = 12.5
START_S = 100.0
BEGUN = datetime(2026, 11, 22, 9, 30, tzinfo=UTC)


def write_force(
    path: Path, *, seconds: float = 4.0, slope: float = SLOPE, close: bool = True
) -> RecordingFile:
    """Write a recording whose force rises evenly while left.x moves by 1 um/s."""
    path.parent.mkdir(parents=True, exist_ok=True)
    scale = Scale("as it is", "uN", (0.0, 1.0))
    channel = ChannelSettings(name="force", board="sim", input="ai0", scale="as it is")
    header = RecordingHeader(RATE_HZ, (channel,), (scale,), BEGUN, START_S)
    file = RecordingFile(path, header)
    add_samples(file, 0.0, seconds, slope)
    if close:
        file.close(complete=True)
    else:
        file.flush()
    return file


def add_samples(file: RecordingFile, begin_s: float, seconds: float, slope: float = SLOPE) -> None:
    scale = Scale("as it is", "uN", (0.0, 1.0))
    first, count = round(begin_s * RATE_HZ), round(seconds * RATE_HZ)
    after_s = (first + np.arange(count)) / RATE_HZ
    for time_s in np.arange(begin_s, begin_s + seconds + 0.01, 0.05):
        file.add_positions([AxisPosition(START_S + time_s, "left.x", 500.0 + time_s)])
    file.append(
        DataChunk(
            first_sample=first,
            time_s=START_S + begin_s,
            rate_hz=RATE_HZ,
            channels=("force",),
            volts=(slope * after_s)[None, :],
            scales=(scale,),
        )
    )
    file.add_event(RecordedEvent(START_S + 1.0, first + 1000, "mark", "touched"))


def write_images(path: Path, *, count: int = 5, step_s: float = 1.0) -> None:
    """Write images, one a second, each a little brighter than the one before."""
    file = ImageFile(path, ImageFormat.PNG)
    for number in range(count):
        time_s = START_S + number * step_s
        data = np.full((64, 96), 40 + 20 * number, np.uint8)
        image = CameraImage("Microscope", Frame(data, number, time_s, time_s), Circumstances())
        file.append(data, row_of(image, BEGUN + timedelta(seconds=number * step_s)))
    file.close(complete=True)


@pytest.fixture
def panel(qtbot: QtBot, tmp_path: Path) -> Iterator[ResultsPanel]:
    made = ResultsPanel(lambda: (tmp_path,), FailurePolicy(), lambda: None)
    qtbot.addWidget(made)
    made.resize(1200, 700)
    made.show()
    yield made
    made.shut_down()


def choose(panel: ResultsPanel, qtbot: QtBot, name: str, *, also: bool = False) -> None:
    """Click a recording in the list, with Ctrl where it is to be compared."""
    sessions = panel.sessions
    qtbot.waitUntil(lambda: sessions.row_of(name) is not None)
    row = sessions.row_of(name)
    assert row is not None
    place = sessions.list.visualItemRect(row).center()
    key = Qt.KeyboardModifier.ControlModifier if also else Qt.KeyboardModifier.NoModifier
    qtbot.mouseClick(sessions.list.viewport(), LEFT, key, place)
    qtbot.waitUntil(lambda: any(t.path.stem.startswith(name) for t in panel.viewer.timelines))


def test_where_nothing_is_chosen_one_sentence_at_the_top_says_what_to_do(
    panel: ResultsPanel,
) -> None:
    viewer = panel.viewer
    assert "Choose a recording" in viewer.facts.text()
    assert viewer.facts.geometry().bottom() < viewer.height() / 10
    assert not any(each.isVisible() for each in (viewer.play, viewer.slider, viewer.export))


def test_a_slope_is_read_over_time_and_over_position(
    panel: ResultsPanel, qtbot: QtBot, tmp_path: Path
) -> None:
    write_force(tmp_path / "monday" / "push.h5")
    panel.refresh()
    choose(panel, qtbot, "push")
    viewer = panel.viewer
    assert f"slope {SLOPE:.3f}" in viewer.slope.text()
    assert "µN/s" in viewer.slope.text()
    viewer.across.setCurrentText("left.x")
    viewer.across.activated.emit(viewer.across.currentIndex())
    line = viewer.curves.slope()
    assert line is not None
    assert line.value == pytest.approx(SLOPE, rel=0.01)
    assert "µN/µm" in viewer.slope.text()


def test_over_an_axis_that_stood_still_there_is_no_slope(
    panel: ResultsPanel, qtbot: QtBot, tmp_path: Path
) -> None:
    file = write_force(tmp_path / "monday" / "push.h5", close=False)
    for after_s in np.arange(0.0, 4.0, 0.05):  # it arrives early, and stands from then on
        here = 388.6 if after_s > 1.0 else 300.0
        file.add_positions([AxisPosition(START_S + float(after_s), "probe.x", here)])
    file.close(complete=True)
    panel.refresh()
    choose(panel, qtbot, "push")
    viewer = panel.viewer
    viewer.curves.cursors.setRegion((2.0, 3.0))
    viewer.across.setCurrentText("probe.x")
    viewer.across.activated.emit(viewer.across.currentIndex())
    assert "no slope, it stood still" in viewer.slope.text()
    assert f"difference {SLOPE:.2f}"[:14] in viewer.slope.text()


def test_the_cursors_bound_what_is_fitted(
    panel: ResultsPanel, qtbot: QtBot, tmp_path: Path
) -> None:
    write_force(tmp_path / "push.h5")
    panel.refresh()
    choose(panel, qtbot, "push")
    panel.viewer.curves.cursors.setRegion((1.0, 2.0))
    assert "1.000 s" in panel.viewer.slope.text()
    assert f"difference {SLOPE:.2f}"[:14] in panel.viewer.slope.text()
    where, _ = panel.viewer.curves.between()
    assert (where.min(), where.max()) == (1.0, 2.0)


def draw_over(panel: ResultsPanel, across: str) -> None:
    """Choose what lies along the horizontal axis."""
    panel.viewer.across.setCurrentText(across)
    panel.viewer.across.activated.emit(panel.viewer.across.currentIndex())


def test_force_over_position_is_that_of_the_time_between_the_cursors(
    panel: ResultsPanel, qtbot: QtBot, tmp_path: Path
) -> None:
    write_force(tmp_path / "push.h5")
    write_force(tmp_path / "other.h5")
    panel.refresh()
    choose(panel, qtbot, "push")
    curves = panel.viewer.curves
    curves.cursors.setRegion((1.0, 2.0))
    draw_over(panel, "left.x")
    (line,) = curves.lines
    assert (line[2].min(), line[2].max()) == pytest.approx((501.0, 502.0), abs=0.1)
    assert curves.region == pytest.approx((501.0, 502.0), abs=0.1)
    field = next(each for each in shown_items(panel, pg.ViewBox) if each.height() > 10.0)
    low, high = field.viewRange()[0]
    assert 500.0 < low < 501.1
    assert 501.9 < high < 503.0
    draw_over(panel, "time")
    assert curves.region == pytest.approx((1.0, 2.0))
    draw_over(panel, "left.x")
    choose(panel, qtbot, "other")
    (line,) = curves.lines
    assert (line[2].min(), line[2].max()) == pytest.approx((500.0, 504.0), abs=0.1)


def shown_items(panel: ResultsPanel, kind: type[Any]) -> list[Any]:
    """Return what is drawn with the curves, from above."""
    view = panel.viewer.curves.findChild(pg.GraphicsView)
    assert view is not None
    found = [each for each in view.scene().items() if isinstance(each, kind) and each.isVisible()]
    return sorted(found, key=lambda each: each.sceneBoundingRect().top())


def keys(panel: ResultsPanel) -> list[str]:
    """Return what is written into the fields, from above."""
    texts = [each.toPlainText() for each in shown_items(panel, QGraphicsTextItem)]
    return [each.replace("\xa0", " ").strip() for each in texts]


def test_each_curve_has_its_name_in_its_colour(
    panel: ResultsPanel, qtbot: QtBot, tmp_path: Path
) -> None:
    write_force(tmp_path / "soft.h5", slope=5.0)
    write_force(tmp_path / "stiff.h5", slope=50.0)
    panel.refresh()
    choose(panel, qtbot, "soft")
    assert "left.x" in keys(panel)
    assert "soft" not in keys(panel), "one curve of force is named by its axis"
    choose(panel, qtbot, "stiff", also=True)
    qtbot.waitUntil(lambda: "soft  stiff" in keys(panel))


def test_the_cursors_are_drawn_in_the_colours_of_the_theme(
    panel: ResultsPanel, qtbot: QtBot, tmp_path: Path, qapp: QApplication
) -> None:
    write_force(tmp_path / "push.h5")
    panel.refresh()
    choose(panel, qtbot, "push")
    cursors, before = panel.viewer.curves.cursors, current_palette()
    try:
        for palette in (LIGHT, DARK):
            apply_theme(qapp, palette.name)
            QApplication.sendPostedEvents()
            assert contrast_ratio(cursors.lines[0].pen.color().name(), palette.field) >= 3.0
            filled = cursors.brush.color()
            ground = blend(filled.name(), palette.field, filled.alphaF())
            assert contrast_ratio(palette.text, ground) >= 7.0
    finally:
        apply_theme(qapp, before.name)


@pytest.mark.parametrize("share", [1000, 10])
def test_the_names_of_the_axes_beside_low_curves_do_not_run_into_each_other(
    panel: ResultsPanel, qtbot: QtBot, tmp_path: Path, share: int
) -> None:
    write_force(tmp_path / "push.h5")
    write_images(tmp_path / "film")
    panel.resize(1016, 460)
    panel.refresh()
    choose(panel, qtbot, "push")
    panel.viewer.split.setSizes([1000, share])
    qtbot.wait(50)
    axes = [each for each in shown_items(panel, pg.AxisItem) if each.orientation == "left"]
    names = [each.label.sceneBoundingRect() for each in axes]
    assert len(names) == 2
    assert names[0].bottom() <= names[1].top() + 1.0
    assert all(each.label.toPlainText().strip() for each in axes)


def test_image_force_position_and_log_go_together(
    panel: ResultsPanel, qtbot: QtBot, tmp_path: Path
) -> None:
    write_force(tmp_path / "push.h5")
    write_images(tmp_path / "film")
    utc = (BEGUN + timedelta(seconds=2.5)).isoformat()
    (tmp_path / "log.tsv").write_text(
        f"time_s\tutc\tlevel\twhere\tmessage\n{START_S + 2.5}\t{utc}\tINFO\tmico\tleft X moves\n"
    )
    panel.refresh()
    choose(panel, qtbot, "push")
    viewer = panel.viewer
    viewer.show_moment(3.2)
    qtbot.waitUntil(lambda: viewer.pictures.image is not None)
    qtbot.waitUntil(lambda: "image 4 of 5" in viewer.pictures.note.text())
    assert "40.00 µN" in viewer.moment.text()
    assert "left.x 503.2" in viewer.moment.text()
    line = viewer.log.currentItem()
    assert line is not None
    assert line.text(1) == "left X moves"
    first = viewer.log.topLevelItem(0)
    assert first is not None
    assert first.text(1) == "touched"
    qtbot.mouseClick(viewer.log.viewport(), LEFT, pos=viewer.log.visualItemRect(first).center())
    assert viewer.after_s == pytest.approx(1.0)
    qtbot.waitUntil(lambda: "image 2 of 5" in viewer.pictures.note.text())


def test_a_film_of_another_day_is_not_shown_beside_a_force(
    panel: ResultsPanel, qtbot: QtBot, tmp_path: Path
) -> None:
    write_force(tmp_path / "push.h5")
    file = ImageFile(tmp_path / "film", ImageFormat.PNG)
    image = np.zeros((64, 96), np.uint8)
    frame = Frame(image, 0, START_S + 1.0, START_S + 1.0)
    row = row_of(CameraImage("Microscope", frame, Circumstances()), BEGUN + timedelta(days=1))
    file.append(image, row)
    file.close(complete=True)
    panel.refresh()
    choose(panel, qtbot, "push")
    assert panel.viewer.timelines[0].films == ()


def test_the_scene_of_the_first_moment_is_that_of_the_first_positions(tmp_path: Path) -> None:
    scale = Scale("as it is", "uN", (0.0, 1.0))
    channel = ChannelSettings(name="force", board="sim", input="ai0", scale="as it is")
    path = tmp_path / "push.h5"
    file = RecordingFile(path, RecordingHeader(RATE_HZ, (channel,), (scale,), BEGUN, START_S))
    for after_s in (0.08, 1.0):
        file.add_positions([AxisPosition(START_S + after_s, "left.x", 3600.0)])
    volts = np.zeros((1, round(2 * RATE_HZ)))
    file.append(DataChunk(0, START_S, RATE_HZ, ("force",), volts, (scale,)))
    file.close(complete=True)
    (session,) = sessions_in([tmp_path])
    timeline = load_timeline(session.items[0])
    assert timeline.poses_at(START_S) == {"left.x": 3600.0}
    assert timeline.poses_at(START_S + 1.9) == {}


def test_where_nothing_was_measured_and_nothing_moved_no_empty_axes_are_drawn(
    panel: ResultsPanel,
) -> None:
    times, still = np.array([0.0, 2.0]), np.full(2, 3600.0)
    axis = Track("left.x", "um", times, still, still, still)
    panel.viewer.show_timelines([Timeline(Path("film"), 0.0, 2.0, None, positions=(axis,))])
    assert not panel.viewer.curves.isVisible()
    assert panel.viewer.pictures.isVisible()


def test_the_keyboard_goes_through_a_recording_and_space_plays_it(
    panel: ResultsPanel, qtbot: QtBot, tmp_path: Path
) -> None:
    write_force(tmp_path / "push.h5")
    panel.refresh()
    choose(panel, qtbot, "push")
    viewer = panel.viewer
    viewer.slider.setFocus()
    qtbot.keyClick(viewer.slider, Qt.Key.Key_PageUp)
    assert viewer.after_s == pytest.approx(0.2, abs=0.01)
    before = viewer.after_s
    qtbot.keyClick(viewer, Qt.Key.Key_Space)
    qtbot.waitUntil(lambda: viewer.after_s > before + 0.1)
    qtbot.keyClick(viewer, Qt.Key.Key_Space)
    assert not viewer.play.isChecked()


def test_recordings_are_compared_each_from_its_start(
    panel: ResultsPanel, qtbot: QtBot, tmp_path: Path
) -> None:
    write_force(tmp_path / "soft.h5", slope=5.0)
    write_force(tmp_path / "stiff.h5", slope=50.0)
    panel.refresh()
    choose(panel, qtbot, "soft")
    choose(panel, qtbot, "stiff", also=True)
    qtbot.waitUntil(lambda: len(panel.viewer.curves.lines) == 2)
    text = panel.viewer.slope.text()
    assert "soft: slope 5.000" in text
    assert "stiff: slope 50.000" in text
    assert "compared with stiff" in panel.viewer.facts.text()


def test_a_longer_recording_that_is_compared_is_seen_to_its_end(
    panel: ResultsPanel, qtbot: QtBot, tmp_path: Path
) -> None:
    write_force(tmp_path / "short.h5", seconds=2.0)
    write_force(tmp_path / "long.h5", seconds=8.0)
    panel.refresh()
    choose(panel, qtbot, "short")
    choose(panel, qtbot, "long", also=True)
    qtbot.waitUntil(lambda: len(panel.viewer.curves.lines) == 2)
    views = shown_items(panel, pg.ViewBox)
    assert len(views) == 2
    for view in views:
        low, high = view.viewRange()[0]
        assert low <= 0.0
        assert high >= 7.9


def test_a_recording_that_is_written_grows_on_the_screen(
    panel: ResultsPanel, qtbot: QtBot, tmp_path: Path
) -> None:
    file = write_force(tmp_path / "now.h5", seconds=1.0, close=False)
    panel.refresh()
    choose(panel, qtbot, "now")
    assert "not closed" in panel.viewer.facts.text()
    add_samples(file, 1.0, 2.0)
    file.flush()
    qtbot.waitUntil(lambda: panel.viewer.timelines[0].end_s - START_S > 2.5)
    file.close(complete=True)
    qtbot.waitUntil(lambda: panel.viewer.timelines[0].complete)


def test_the_recording_of_a_killed_process_is_shown(
    panel: ResultsPanel, qtbot: QtBot, tmp_path: Path
) -> None:
    child = (
        "import sys, time; from pathlib import Path;"
        "from gui.app.test_results import write_force;"
        "f = write_force(Path(sys.argv[1]), close=False); print('written', flush=True);"
        "time.sleep(60)"
    )
    path = tmp_path / "killed.h5"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    with subprocess.Popen(
        [sys.executable, "-c", child, str(path)], stdout=subprocess.PIPE, env=environment
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline().strip() == b"written"
        process.send_signal(signal.SIGKILL)
    panel.refresh()
    choose(panel, qtbot, "killed")
    assert "not closed" in panel.viewer.facts.text()
    assert f"slope {SLOPE:.3f}" in panel.viewer.slope.text()


def test_what_is_no_recording_says_so(panel: ResultsPanel, qtbot: QtBot, tmp_path: Path) -> None:
    (tmp_path / "broken.h5").write_bytes(b"no recording")
    panel.refresh()
    sessions = panel.sessions
    qtbot.waitUntil(lambda: sessions.row_of("broken") is not None)
    row = sessions.row_of("broken")
    assert row is not None
    row.setSelected(True)
    qtbot.waitUntil(lambda: "cannot be shown" in panel.message.text())


def test_sample_operator_and_note_are_kept_and_found(
    panel: ResultsPanel, qtbot: QtBot, tmp_path: Path
) -> None:
    folder = tmp_path / "monday"
    write_force(folder / "push.h5")
    write_force(tmp_path / "tuesday" / "other.h5")
    (folder / "session.toml").write_text("# kept by hand\nroom = 'B12'\n")
    panel.refresh()
    choose(panel, qtbot, "push")
    sessions = panel.sessions
    sessions.sample.setFocus()
    qtbot.keyClicks(sessions.sample, "pine kraft")
    qtbot.keyClick(sessions.sample, Qt.Key.Key_Return)
    assert read_about(folder).sample == "pine kraft"
    kept = (folder / "session.toml").read_text()
    assert "# kept by hand" in kept
    assert "B12" in kept
    sessions.search.setText("kraft")
    qtbot.waitUntil(lambda: sessions.row_of("other") is None)
    qtbot.waitUntil(lambda: sessions.row_of("push") is not None)


def test_what_is_seen_is_exported(panel: ResultsPanel, qtbot: QtBot, tmp_path: Path) -> None:
    write_force(tmp_path / "push.h5")
    panel.refresh()
    choose(panel, qtbot, "push")
    panel.viewer.curves.cursors.setRegion((1.0, 1.5))
    qtbot.mouseClick(panel.viewer.export, LEFT)
    assert (tmp_path / "push_seen.png").stat().st_size > 1000
    table = (tmp_path / "push_seen_values.csv").read_text().splitlines()
    assert table[0] == 'recording,time_s,"force, µN"'
    assert table[1] == "push,1,12.5"
    assert len(table) == 502
    opened: list[Path] = []
    panel.open_file = opened.append
    qtbot.mouseClick(panel.message, LEFT)
    assert opened == [tmp_path / "push_seen.png"]
    qtbot.mouseClick(panel.viewer.export, LEFT)
    assert (tmp_path / "push_seen_2.png").exists()
    panel.refresh()
    qtbot.wait(100)
    assert panel.sessions.row_of("push_seen_values") is None  # a table is no film


def test_the_report_of_a_recording_holds_what_was_measured_and_what_happened(
    panel: ResultsPanel, qtbot: QtBot, tmp_path: Path
) -> None:
    write_force(tmp_path / "push <1>.h5")
    write_images(tmp_path / "film")
    write_about(tmp_path, About(sample="pine & birch", operator="Ann"))
    panel.refresh()
    choose(panel, qtbot, "push <1>")
    opened: list[Path] = []
    panel.open_file = opened.append
    qtbot.mouseClick(panel.viewer.report, LEFT)
    qtbot.waitUntil(lambda: bool(opened))
    assert opened == [tmp_path / "push <1>_report.html"]
    page = opened[0].read_text(encoding="utf-8")
    assert "<h1>push &lt;1&gt;</h1>" in page
    assert "pine &amp; birch" in page
    assert "Ann" in page
    assert f"{(4.0 * RATE_HZ - 1) / RATE_HZ * SLOPE:.2f} µN" in page, "the highest force"
    assert "force over time, s" in page
    assert "force over left.x, µm" in page
    assert "touched" in page
    assert "Microscope at the highest force, after 4.00 s." in page
    assert "data:image/png;base64," in page
    assert panel.sessions.row_of("push <1>_report") is None


@pytest.mark.parametrize("value", [1.0, math.nan])
def test_a_force_that_never_changed_or_was_never_known_has_a_report(
    tmp_path: Path, value: float
) -> None:
    values = np.full(50, value)
    track = Track("force", "uN", np.linspace(0.0, 1.0, 50), values, values, values)
    shown = Timeline(tmp_path / "flat.h5", 0.0, 1.0, BEGUN, RATE_HZ, (track,))
    write_recording_report(shown, About(), tmp_path / "flat.html")
    assert "Nothing was noted." in (tmp_path / "flat.html").read_text(encoding="utf-8")


def test_the_image_of_a_report_is_seen_where_a_camera_gives_12_bits(tmp_path: Path) -> None:
    write_force(tmp_path / "push.h5")
    file = ImageFile(tmp_path / "film", ImageFormat.PNG)
    for number in range(5):
        time_s = START_S + number
        data = np.tile(np.linspace(0, 4095, 96).astype(np.uint16), (64, 1))
        frame = Frame(data, number, time_s, time_s, pixel_format=PixelFormat.MONO12)
        image = CameraImage("Microscope", frame, Circumstances())
        file.append(data, row_of(image, BEGUN + timedelta(seconds=number)))
    file.close(complete=True)
    items = [each for session in sessions_in([tmp_path]) for each in session.items]
    force = next(each for each in items if each.name.startswith("push"))
    write_recording_report(load_timeline(force, items), About(), tmp_path / "push.html")
    page = (tmp_path / "push.html").read_text(encoding="utf-8")
    content = page.split("data:image/png;base64,")[1].split('"')[0]
    shown = cv2.imdecode(np.frombuffer(base64.b64decode(content), np.uint8), cv2.IMREAD_UNCHANGED)
    assert shown.dtype == np.uint8
    assert shown.min() < 10
    assert shown.max() > 245


def test_a_report_that_cannot_be_written_says_so(
    panel: ResultsPanel, qtbot: QtBot, tmp_path: Path
) -> None:
    write_force(tmp_path / "push.h5")
    (tmp_path / "push_report.html").mkdir()
    panel.refresh()
    choose(panel, qtbot, "push")
    panel.open_file = pytest.fail
    qtbot.mouseClick(panel.viewer.report, LEFT)
    qtbot.waitUntil(lambda: "cannot be written" in panel.message.text())


def test_what_was_exported_is_no_recording_and_leaves_the_day_of_its_session(
    panel: ResultsPanel, qtbot: QtBot, tmp_path: Path
) -> None:
    write_force(tmp_path / "before" / "push.h5")
    when = time.time() - 9 * 86_400
    os.utime(tmp_path / "before" / "push.h5", (when, when))
    panel.refresh()
    choose(panel, qtbot, "push")
    for _ in range(2):
        qtbot.mouseClick(panel.viewer.export, LEFT)
    assert (tmp_path / "before" / "push_seen_2.png").exists()
    (session,) = sessions_in([tmp_path])
    assert [each.name for each in session.items] == ["push"]
    assert session.changed.timestamp() == pytest.approx(when, abs=1.0)


def test_yesterdays_record_is_found_and_its_slope_read_in_six_actions(
    panel: ResultsPanel, qtbot: QtBot, tmp_path: Path
) -> None:
    write_force(tmp_path / "now" / "today.h5", slope=1.0)
    write_force(tmp_path / "before" / "push.h5")
    write_force(tmp_path / "long ago" / "push.h5", slope=2.0)
    now = time.time()
    for name, days in (("before", 1), ("long ago", 9)):
        when = now - days * 86_400
        os.utime(tmp_path / name / "push.h5", (when, when))
    panel.refresh()
    actions = 1  # the button of the workspace, counted here
    sessions = panel.sessions
    qtbot.waitUntil(lambda: len(sessions.sessions) == 3)
    sessions.search.setFocus()
    qtbot.keyClicks(sessions.search, "yesterday")
    actions += 1
    assert sessions.row_of("today") is None
    choose(panel, qtbot, "push")
    actions += 1
    assert actions <= 6
    assert f"slope {SLOPE:.3f}" in panel.viewer.slope.text()


def test_thumbnails_show_what_was_recorded(
    panel: ResultsPanel, qtbot: QtBot, tmp_path: Path
) -> None:
    write_force(tmp_path / "push.h5")
    write_images(tmp_path / "film")
    panel.refresh()
    sessions = panel.sessions
    qtbot.waitUntil(lambda: sessions.row_of("film") is not None)

    def drawn(name: str) -> int:
        row = sessions.row_of(name)
        assert row is not None
        image = row.icon(0).pixmap(56, 32).toImage()
        places = [(x, y) for x in range(image.width()) for y in range(image.height())]
        return sum(image.pixelColor(x, y).alpha() > 0 for x, y in places)

    qtbot.waitUntil(lambda: drawn("film") > 100)
    qtbot.waitUntil(lambda: drawn("push") > 5)


@pytest.mark.parametrize("size", [(1016, 460), (1358, 630), (1912, 940)])
def test_nothing_of_a_recording_is_cut_off(
    panel: ResultsPanel, qtbot: QtBot, tmp_path: Path, size: tuple[int, int]
) -> None:
    write_force(tmp_path / "push.h5")
    write_images(tmp_path / "film")
    panel.resize(*size)
    panel.refresh()
    choose(panel, qtbot, "push")
    qtbot.waitUntil(lambda: panel.viewer.pictures.image is not None)
    assert panel.size().toTuple() == size
    assert clipped(panel) == []
    assert overlapping(panel) == []


def test_the_folder_of_a_session_goes_along_with_that_of_all(tmp_path: Path) -> None:
    folder = SessionFolder()
    folder.home = tmp_path / "sessions"
    made = folder()
    assert made.is_dir()
    assert made.parent == tmp_path / "sessions"


def item_names(panel: ResultsPanel) -> set[str]:
    return {item.name for session in panel.sessions.sessions for item in session.items}


def test_the_images_of_a_film_are_listed_once_as_a_film(
    panel: ResultsPanel, qtbot: QtBot, tmp_path: Path
) -> None:
    write_images(tmp_path / "film", count=3)
    panel.refresh()
    qtbot.waitUntil(lambda: panel.sessions.row_of("film") is not None)
    assert item_names(panel) == {"film"}
    row = panel.sessions.row_of("film")
    assert row is not None
    files = [tmp_path / "film.csv", *(tmp_path / "film").iterdir()]
    assert row.text(1) == size_text(sum(each.stat().st_size for each in files))


def test_a_folder_that_cannot_be_read_hides_no_other(
    panel: ResultsPanel, qtbot: QtBot, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in ("a", "b", "c"):
        write_force(tmp_path / name / f"{name}.h5", seconds=0.1)
    plain = Path.stat

    def stat(path: Path, **kwargs: bool) -> os.stat_result:
        if path.parent == tmp_path / "b":
            raise PermissionError(13, "Permission denied", str(path))
        return plain(path, **kwargs)

    monkeypatch.setattr(Path, "stat", stat)
    panel.refresh()
    qtbot.waitUntil(lambda: bool(panel.sessions.sessions))
    assert item_names(panel) >= {"a", "c"}


STILLS: dict[str, Any] = {
    "colour16.png": np.full((64, 96, 3), 40_000, np.uint16),
    "colour16.tif": np.full((64, 96, 3), 40_000, np.uint16),
    "floats.tif": np.linspace(0.0, 1.0, 64 * 96, dtype=np.float32).reshape(64, 96),
    "heights.tif": np.where(np.eye(64, 96) > 0, np.nan, np.arange(96.0)).astype(np.float32),
    "signed.tif": np.arange(-3072, 3072, dtype=np.int16).reshape(64, 96),
    "mask.tif": np.eye(64, 96) > 0,
}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("name", STILLS)
def test_an_image_of_another_program_is_shown_whatever_its_numbers(
    panel: ResultsPanel, qtbot: QtBot, tmp_path: Path, name: str
) -> None:
    data = STILLS[name]
    if name.endswith(".png"):
        cv2.imwrite(str(tmp_path / name), data)
    else:
        tifffile.imwrite(tmp_path / name, data)
    panel.refresh()
    choose(panel, qtbot, Path(name).stem)
    pictures = panel.viewer.pictures
    qtbot.waitUntil(lambda: pictures.image is not None)
    shown = pictures.view.grab().toImage()
    middle = shown.pixelColor(shown.width() // 2, shown.height() // 2)
    if name != "mask.tif":
        assert middle.value() > 20
    assert pictures.image is not None
    assert pictures.image.data.shape[:2] == (64, 96)


def test_over_an_axis_that_turns_everything_is_in_degrees(
    panel: ResultsPanel, qtbot: QtBot, tmp_path: Path
) -> None:
    file = write_force(tmp_path / "turn.h5", close=False)
    for after_s in np.arange(0.0, 4.01, 0.05):
        file.add_positions([AxisPosition(START_S + after_s, "table", 2.0 * after_s, unit="deg")])
    file.close(complete=True)
    panel.refresh()
    choose(panel, qtbot, "turn")
    viewer = panel.viewer
    viewer.across.setCurrentText("table")
    viewer.across.activated.emit(viewer.across.currentIndex())
    assert "µN/°" in viewer.slope.text()
    assert "µm" not in viewer.slope.text()


def test_an_export_replaces_no_file_whatever_the_recording_is_called(
    panel: ResultsPanel, qtbot: QtBot, tmp_path: Path
) -> None:
    write_force(tmp_path / "push 0.5 N [2].h5")
    (tmp_path / "push 0.png").write_bytes(b"somebody's")
    panel.refresh()
    choose(panel, qtbot, "push 0.5")
    for _ in range(2):
        qtbot.mouseClick(panel.viewer.export, LEFT)
    assert (tmp_path / "push 0.png").read_bytes() == b"somebody's"
    for name in ("push 0.5 N [2]_seen", "push 0.5 N [2]_seen_2"):
        assert (tmp_path / f"{name}.png").stat().st_size > 1000
        assert (tmp_path / f"{name}_values.csv").exists()


def test_what_was_chosen_last_is_shown_after_one_that_cannot_be(
    panel: ResultsPanel, qtbot: QtBot, tmp_path: Path
) -> None:
    (tmp_path / "broken.h5").write_bytes(b"no recording")
    write_force(tmp_path / "push.h5")
    panel.refresh()
    sessions = panel.sessions
    qtbot.waitUntil(lambda: sessions.row_of("push") is not None)
    for name in ("broken", "push"):
        row = sessions.row_of(name)
        assert row is not None
        sessions.list.setCurrentItem(row)
    qtbot.waitUntil(lambda: [t.path.stem for t in panel.viewer.timelines] == ["push"])
    assert "cannot be shown" not in panel.message.text()
