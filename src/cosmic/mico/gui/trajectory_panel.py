"""The panel of SCM: trajectories are opened, recorded, rehearsed and run; poses are taught."""

import logging
from collections.abc import Callable
from pathlib import Path
from typing import Final

from PySide6.QtCore import QObject, Signal
from PySide6.QtWidgets import QLabel, QVBoxLayout, QWidget

from cosmic.frame.errors import CosmicError
from cosmic.frame.gui.ask_directory import ask_open_file, ask_save_file
from cosmic.frame.gui.build import named, push_button, tight_row
from cosmic.frame.gui.elided_label import ElidedLabel
from cosmic.frame.gui.flow_layout import FlowLayout
from cosmic.frame.gui.relay import Relay
from cosmic.frame.gui.state_badge import StateBadge
from cosmic.frame.gui.theme import STEP_PX, State, ui_font
from cosmic.frame.kept_file import open_file
from cosmic.frame.operation import Task
from cosmic.mico.api.mico import Mico
from cosmic.mico.api.trajectories import Trajectories
from cosmic.mico.api.trajectory_player import TrajectoryPlayer
from cosmic.mico.api.trajectory_recording import TrajectoryRecording
from cosmic.mico.api.trajectory_state import PlayProgress, PlayState
from cosmic.mico.core.trajectory.model import SUFFIX, Problem, Trajectory, TrajectoryError
from cosmic.mico.core.trajectory.reader import LARGEST_BYTES
from cosmic.mico.core.trajectory.rehearsal import Rehearsal
from cosmic.mico.gui.poses_box import PosesBox
from cosmic.mico.gui.trajectory_bars import RecordBar, RunBar, StartQuestion
from cosmic.mico.gui.trajectory_lines import TrajectoryLines
from cosmic.mico.gui.trajectory_play import PlayControl

logger = logging.getLogger(__name__)

FILTER: Final = f"Trajectories (*{SUFFIX});;All files (*)"
_STATES: Final = {
    PlayState.READY: State.OK,
    PlayState.RUNNING: State.BUSY,
    PlayState.PAUSED: State.UNKNOWN,
    PlayState.FAILED: State.ERROR,
    PlayState.CANCELLED: State.REFUSED,
    PlayState.ENDED: State.OK,
}


class TrajectoryPanel(QWidget):
    """Everything about one trajectory; GUI thread. Nothing here waits.

    Signals
    -------
    preview_changed(object)
        Poses of all axes along the trajectory after a rehearsal, for the scene; None: none.
    refused(MoveVerdict)
        The rehearsal met a line that the gate refuses.
    """

    preview_changed = Signal(object)
    refused = Signal(object)

    def __init__(self, mico: Mico, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("trajectoryPanel")
        self._mico = mico
        self._application = mico.application
        self._api = mico.trajectories
        self._make_widgets()
        self._recorder = _RecordControl(mico.trajectories, self.record_bar, self)
        self._play = PlayControl(mico, self.run_bar, self.question, self)
        self._arrange()
        self._connect()
        self._show_player()

    def _make_widgets(self) -> None:
        self.open_button = named(push_button("Open…", "Read a trajectory and check it"), "open")
        self.mirror_button = named(
            push_button("Mirror", "The same for the opposite assembly"), "mirror"
        )
        self.rehearse_button = named(
            push_button("Rehearse", "Run it through the gate without moving"), "rehearse"
        )
        self.badge = StateBadge(State.UNKNOWN)
        self.title = named(ElidedLabel("no trajectory"), "trajectoryTitle")
        self.title.setFont(ui_font(bold=True))
        self.report = named(QLabel(), "trajectoryReport")
        self.report.setWordWrap(True)
        self.lines = TrajectoryLines()
        self.record_bar = RecordBar()
        self.run_bar = RunBar()
        self.question = StartQuestion()
        self.poses_box = PosesBox(self._mico)
        self.record_bar.set_poses(self._mico.poses.names)

    def _arrange(self) -> None:
        head, beside = tight_row(STEP_PX)
        beside.addWidget(self.badge)
        beside.addWidget(self.title, 1)
        buttons, flow = QWidget(), FlowLayout(STEP_PX)
        buttons.setLayout(flow)
        for button in (self.open_button, self.mirror_button, self.rehearse_button):
            flow.addWidget(button)
        column = QVBoxLayout(self)
        column.setContentsMargins(STEP_PX, STEP_PX, STEP_PX, STEP_PX)
        column.setSpacing(STEP_PX)
        column.addWidget(self.record_bar)
        column.addWidget(head)
        column.addWidget(buttons)
        column.addWidget(self.lines, 1)
        for widget in (self.report, self.question, self.run_bar, self.poses_box):
            column.addWidget(widget)

    def _connect(self) -> None:
        self._loaded_relay = Relay(self._on_loaded)
        self._rehearsed_relay = Relay(self._on_rehearsed)
        self._recorder.recorded.connect(self.open)
        self.open_button.clicked.connect(self._on_open)
        self.mirror_button.clicked.connect(self.mirror)
        self.rehearse_button.clicked.connect(self.rehearse)
        self.record_bar.record_requested.connect(self._on_record)
        self._play.progressed.connect(self._on_progressed)
        self._play.refused.connect(self._on_failed)
        self.poses_box.poses_changed.connect(self._on_poses_changed)

    @property
    def trajectory(self) -> Trajectory | None:
        """The trajectory shown, if it can be run."""
        return self._play.trajectory

    @property
    def player(self) -> TrajectoryPlayer | None:
        """Its player; None before it was run."""
        return self._play.player

    # Opening

    def _on_open(self) -> None:
        ask_open_file(
            self, "Open a trajectory", "", files=FILTER, chosen=lambda name: self.open(Path(name))
        )

    def open(self, path: Path) -> None:
        """Read a file in the application's thread; what is wrong with it is shown."""

        def read(task: Task) -> None:
            try:
                found = self._api.load(path, lambda part: task.report(part, "reading"))
            except CosmicError as exc:
                self._loaded_relay(path, exc)
            else:
                self._loaded_relay(path, found)
            task.finish()

        self._begin(f"Reading {path.name}", read)

    def _begin(self, title: str, job: Callable[[Task], None]) -> None:
        try:
            self._application.begin(title, job)
        except CosmicError as exc:
            self._say(str(exc), State.REFUSED)

    def _on_loaded(self, path: Path, found: object) -> None:
        self._forget()
        if isinstance(found, Trajectory):
            self._show_trajectory(found)
            return
        self.title.set_text(path.name)
        self.lines.lines.set_lines(_lines_of(path))
        if isinstance(found, TrajectoryError):
            self.lines.lines.set_problems(found.problems)
            self.lines.look_at(found.problems[0].line)
            count = len(found.problems)
            more = "" if count == 1 else f", and {count - 1} more"
            self._say(f"{found.problems[0]}{more}", State.REFUSED)
        else:
            self._say(str(found), State.REFUSED)
        self._show_player()

    def _show_trajectory(self, trajectory: Trajectory) -> None:
        self._play.take(trajectory)
        self.title.set_text(trajectory.name)
        self.lines.lines.set_lines(trajectory.lines)
        count = len(trajectory.lines)
        self._say(f"{count} lines, nothing wrong. Rehearse it to see what it does.", State.OK)
        self._show_player()

    def _forget(self) -> None:
        """Let go of the trajectory shown; one that is paused is given up."""
        self._play.forget()
        self.preview_changed.emit(None)

    def mirror(self) -> None:
        """Show the trajectory for the opposite assembly."""
        if self.trajectory is None:
            return
        try:
            found = self._api.mirror(self.trajectory)
        except CosmicError as exc:
            self._say(str(exc), State.REFUSED)
            return
        self._forget()
        self._show_trajectory(found)

    # Recording

    def _on_record(self) -> None:
        ask_save_file(
            self,
            "Record movements to",
            "",
            files=FILTER,
            suffix=SUFFIX,
            chosen=lambda name: self.record(Path(name)),
        )

    def record(self, path: Path) -> None:
        """Begin to record as the bar says; the dialogue has asked about a file that is there."""
        self._recorder.record(path)

    # Rehearsing

    def rehearse(self) -> None:
        """Run it through the gate in the application's thread, without moving anything."""
        trajectory, speed = self.trajectory, self.run_bar.speed.value()
        if trajectory is None:
            return

        def play(task: Task) -> None:
            try:
                found = self._api.rehearse(
                    trajectory, task.report, speed=speed, cancelled=lambda: task.cancel_requested
                )
            except CosmicError as exc:
                self._rehearsed_relay(trajectory, exc)
                task.fail(exc)
            else:
                self._rehearsed_relay(trajectory, found)
                task.finish()

        self._say("rehearsing", State.BUSY)
        self._begin(f"Rehearsing {trajectory.name}", play)

    def _on_rehearsed(self, trajectory: Trajectory, found: Rehearsal | CosmicError) -> None:
        if trajectory is not self.trajectory:
            return  # another is shown by now, and nobody rehearsed that
        if isinstance(found, CosmicError):
            self._on_failed(str(found))
            return
        self._show_rehearsal(found)
        self.preview_changed.emit(found.poses)

    def _show_rehearsal(self, found: Rehearsal) -> None:
        if found.allowed:
            self._say(_rehearsal_text(found), State.OK)
            return
        self.lines.lines.set_problems([Problem(found.line, str(found.verdict))])
        self.lines.look_at(found.line)
        self._say(f"line {found.line}: {found.verdict}", State.REFUSED)
        self.refused.emit(found.verdict)

    def _on_failed(self, text: str) -> None:
        self._say(text, State.REFUSED)

    # Running

    def _on_progressed(self, progress: PlayProgress) -> None:
        self.run_bar.show_state(progress, ready=True)
        self.lines.show_line(0 if progress.state is PlayState.ENDED else progress.line)
        if progress.error:
            self.lines.lines.set_problems([Problem(progress.line, progress.error)])
        elif progress.state in (PlayState.RUNNING, PlayState.ENDED) and self.lines.lines.problems:
            self.lines.lines.set_problems([])  # it went on
        words = progress.error or progress.text
        player = self.player
        if progress.state is PlayState.ENDED and player and player.rehearsal is not None:
            words = f"done. {_rehearsal_text(player.rehearsal)}"
        word = "PAUSED" if progress.state is PlayState.PAUSED else ""
        self._say(words, _STATES[progress.state], word=word)
        self._enable(running=progress.state is PlayState.RUNNING)

    # Showing

    def _on_poses_changed(self) -> None:
        self.record_bar.set_poses(self._mico.poses.names)

    def _show_player(self) -> None:
        progress = self.player.progress if self.player is not None else None
        self.run_bar.show_state(progress, ready=self.trajectory is not None)
        self._enable(running=False)

    def _enable(self, *, running: bool) -> None:
        there = self.trajectory is not None
        self.open_button.setEnabled(not running)
        self.mirror_button.setEnabled(there and not running)
        self.rehearse_button.setEnabled(there and not running)

    def _say(self, text: str, state: State, *, word: str = "") -> None:
        self.report.setText(text)
        self.badge.set_state(state, word=word)


class _RecordControl(QObject):
    """Begins and ends a recording; GUI thread. Nothing here waits.

    Signals
    -------
    recorded(Path)
        A recording was ended, and its file is whole.
    """

    recorded = Signal(object)

    def __init__(self, api: Trajectories, bar: RecordBar, parent: QObject) -> None:
        super().__init__(parent)
        self._api = api
        self._bar = bar
        self._recording: TrajectoryRecording | None = None
        self._relay = Relay(self._on_changed)
        bar.stop_requested.connect(self.stop)

    def record(self, path: Path) -> None:
        """Begin to record as the bar says, in place of what is in the file."""
        bar = self._bar
        try:
            self._recording = self._api.record(
                path,
                title=path.stem,
                timed=bar.timed.isChecked(),
                relative_to=bar.relative_to,
                sources=bar.sources,
                overwrite=True,
            )
        except CosmicError as exc:
            bar.show_recording(str(exc), recording=False)
            return
        self._recording.subscribe(self._relay)
        self._on_changed()

    def stop(self) -> None:
        """End the recording."""
        recording, self._recording = self._recording, None
        if recording is None:
            return
        recording.stop()
        self._bar.show_recording(_recording_text(recording), recording=False)
        if recording.error is None:
            self.recorded.emit(recording.path)

    def _on_changed(self) -> None:
        if self._recording is not None:
            error = self._recording.error
            self._bar.show_recording(_recording_text(self._recording), recording=error is None)


def _rehearsal_text(found: Rehearsal) -> str:
    """Return what a rehearsal found, for the operator."""
    parts = [f"{found.lines} lines in about {found.duration_s:.1f} s"]
    if found.clearance_um is not None:
        where = f"line {found.clearance_line}" if found.clearance_line else "the start"
        bodies = " and ".join(found.clearance_bodies)
        parts.append(f"smallest clearance {found.clearance_um:.0f} µm at {where} ({bodies})")
    ends = [f"{axis} {value:.1f}" for axis, value in found.end.items()]
    if ends:
        parts.append(f"ends at {', '.join(ends)}")
    return "; ".join(parts)


def _recording_text(recording: TrajectoryRecording) -> str:
    """Return what has become of a recording, for the operator."""
    if recording.error is not None:
        return str(recording.error)
    return f"{recording.path.name}: {recording.lines} lines"


def _lines_of(path: Path) -> list[str]:
    """Return what can be shown of a file that is not a trajectory."""
    try:
        with open_file(path) as file:
            data = file.read(LARGEST_BYTES)
    except OSError:
        return []
    return data.decode("utf-8", errors="replace").splitlines()


def make_trajectory_panel(mico: Mico) -> TrajectoryPanel:
    """Return the panel of SCM for a window."""
    return TrajectoryPanel(mico)
