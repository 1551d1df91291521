"""The first day with a platform: what is there, what is missing, and what to press, in order."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Final

from PySide6.QtCore import QTimer, Signal
from PySide6.QtGui import QGuiApplication, QHideEvent, QShowEvent
from PySide6.QtWidgets import QGridLayout, QLabel, QVBoxLayout, QWidget

from cosmic.app.commands.setup import entries, unnamed_axes
from cosmic.app.configuration.axes_seen import note_axes
from cosmic.app.rig import Rig
from cosmic.autonomy.coordinate_transform import PlatformTransform
from cosmic.autonomy.stage_check import StageReport
from cosmic.frame.errors import ConfigError, CosmicError, NotAvailable
from cosmic.frame.gui.build import named, push_button
from cosmic.frame.gui.key_focus import set_shown, set_usable
from cosmic.frame.gui.state_badge import StateBadge
from cosmic.frame.gui.theme import STEP_PX, State
from cosmic.frame.kept_file import write_whole
from cosmic.frame.operation import Operation, Task
from cosmic.frame.overrides import override
from cosmic.frame.units import with_micro_signs
from cosmic.mico.core.motion.positioner import Confidence
from cosmic.mico.gui.mico_widget import MicoWidget
from cosmic.mico.hw.interface import PositionerKind
from cosmic.vico.api.camera import CameraHandle
from cosmic.vico.hw.peripherals import LensAxis

LOOK_MS: Final = 500


@dataclass(frozen=True)
class Standing:
    """How far one step is.

    Attributes
    ----------
    text : str
        What is so, or what is missing and what to press.
    button : str
        Stands on the button; empty where there is nothing to press.
    """

    state: State
    text: str
    button: str = ""


@dataclass(frozen=True)
class DayStep:
    """One step of the first day.

    Attributes
    ----------
    title : str
        What it is about.
    look : callable
        Returns how far it is.
    act : callable
        What its button does; text that it returns is shown.
    cancel : callable or None
        Ends what runs; None: it ends by itself, and soon.
    """

    title: str
    look: Callable[[], Standing]
    act: Callable[[], object]
    cancel: Callable[[], object] | None = None


class FirstDaySteps:
    """Looks at a platform step by step, from the devices to the first click that moves a tool.

    Parameters
    ----------
    tool, camera : callable
        Return the name of the tool that is chosen, and the camera that is shown.
    folder : callable
        Returns where the report on the axes goes; may raise `OSError`.
    click : callable
        Shows the image with a click that moves the tool.
    config : Path or None
        The platform file, where what is found of axes is noted; None: nowhere.
    """

    def __init__(
        self,
        rig: Rig,
        gui: MicoWidget,
        *,
        configured: Sequence[str],
        force: bool,
        tool: Callable[[], str],
        camera: Callable[[], CameraHandle],
        folder: Callable[[], Path],
        click: Callable[[], object],
        config: Path | None = None,
    ) -> None:
        self._config = config
        self._rig, self._gui, self._configured, self._force = rig, gui, configured, force
        self._tool, self._camera, self._folder, self._click = tool, camera, folder, click
        self._calibrating: Task | None = None
        self._checking: Operation[StageReport] | None = None
        self._check: Task | None = None
        self._report = ""

    @property
    def steps(self) -> tuple[DayStep, ...]:
        """All of them, in order."""
        rig = self._rig
        return (
            DayStep("Devices", self.devices, lambda: self._gui.mico.rescan(wait=False)),
            DayStep("Names", self.names, self.copy_entries),
            DayStep("Positions", self.positions, self.initialise, self.cancel_initialisation),
            *((DayStep("Force", self.force, rig.daqco.start),) if self._force else ()),
            DayStep("Camera", self.camera, lambda: self._camera().start()),
            DayStep("Lens", self.lens, self.home_lens, self.abort_lens),
            DayStep("Scale and rotation", self.scale, self.calibrate, self.cancel_calibration),
            DayStep("Know your stage", self.stage, self.check_stage, self.cancel_check),
            DayStep("First click-to-move", self.click, self._click),
        )

    def devices(self) -> Standing:
        """Look at what was found."""
        mico = self._gui.mico
        if mico.failure:
            return Standing(State.ERROR, f"{mico.failure}. Check power and cable.", "Rescan")
        if not mico.ready:
            return Standing(State.BUSY, "Looking for devices")
        # What nobody has named is not used, and counts as absent there.
        own = [axis for axis in mico if axis.key in self._configured]
        absent = [axis.key for axis in own if not axis.details.present]
        if absent:
            of = f"{len(absent)} of {len(own)} axes"
            text = f"{of} of the platform file do not answer: {', '.join(absent)}"
            return Standing(State.ERROR, text, "Rescan")
        return Standing(State.OK, f"{len(own)} axes answer", "Rescan")

    def names(self) -> Standing:
        """Look for axes that nobody has named."""
        if not self._gui.mico.ready:
            return Standing(State.UNKNOWN, "After the devices")
        found = unnamed_axes(self._gui.mico, self._configured)
        if not found:
            return Standing(State.OK, "Every axis has a name and a place")
        text = (
            f"Without entry in the platform file: {', '.join(each.name for each in found)}. Copy "
            "entries, name and limit them there; cosmic setup --write does the same"
        )
        return Standing(State.UNKNOWN, text, "Copy entries")

    def copy_entries(self) -> str:
        """Put the entries for axes without a name into the clipboard."""
        found = unnamed_axes(self._gui.mico, self._configured)
        QGuiApplication.clipboard().setText(entries(found))
        return "Entries copied: paste them into the platform file, then start again"

    @property
    def _initialising(self) -> Task | None:
        """What drives all axes now; none of its own counts while devices are looked for."""
        task = self._gui.mico.application.running_task
        return task if task is not None and not task.done and self._gui.mico.ready else None

    def initialise(self) -> None:
        """Begin the initialisation sequence."""
        if why := self._gui.busy:
            raise NotAvailable(why)
        self._gui.initialise()

    def cancel_initialisation(self) -> None:
        """End the initialisation sequence; what moves is stopped."""
        _cancel(self._initialising)

    def positions(self) -> Standing:
        """Look at what is known of the positions."""
        running = self._initialising
        if running is not None:
            return Standing(State.BUSY, running.progress.text or running.title)
        unknown = [
            axis.key
            for axis in self._gui.mico
            if axis.kind is not PositionerKind.OPEN_LOOP
            and axis.details.present
            and axis.details.confidence is Confidence.UNKNOWN
        ]
        if unknown:
            text = f"The position of {', '.join(unknown)} is unknown"
            return Standing(State.UNKNOWN, text, "Initialise")
        return Standing(State.OK, "All positions are known")

    def force(self) -> Standing:
        """Look at the acquisition and its limits."""
        daqco = self._rig.daqco
        if not daqco.running:
            return Standing(State.UNKNOWN, daqco.problem or "The force is not measured", "Start")
        armed = [each.settings.channel for each in daqco.limits if each.settings.armed]
        channels = ", ".join(daqco.channels)
        if not armed:
            text = f"{channels} are measured; no limit is armed. Set one in Measure, Limit…"
            return Standing(State.UNKNOWN, text)
        return Standing(
            State.OK, f"{channels} are measured; a limit of {', '.join(armed)} is armed"
        )

    def camera(self) -> Standing:
        """Look at the camera."""
        camera = self._camera()
        if camera.problem:
            return Standing(State.ERROR, camera.problem)
        if not camera.running:
            return Standing(State.UNKNOWN, f"{camera.name} is stopped", "Start")
        return Standing(State.OK, f"{camera.name} takes images")

    def lens(self) -> Standing:
        """Look at the lens."""
        lens = self._rig.vico.lens
        if lens is None:
            return Standing(State.OK, "No motorised lens is configured")
        if lens.problem:
            return Standing(State.ERROR, lens.problem)
        states = [lens.state(axis) for axis in LensAxis]
        if any(state is not None and state.moving for state in states):
            return Standing(State.BUSY, "Zoom and focus are moving")
        if all(state is not None and state.homed for state in states):
            return Standing(State.OK, "Zoom and focus are known")
        return Standing(State.UNKNOWN, "Zoom and focus are unknown", "Home lens")

    def home_lens(self) -> None:
        """Home both motors."""
        if self._rig.vico.lens is not None:
            self._rig.vico.lens.home()

    def abort_lens(self) -> None:
        """Stop both motors."""
        if self._rig.vico.lens is not None:
            self._rig.vico.lens.abort()

    def scale(self) -> Standing:
        """Look at the calibration of the camera."""
        running = self._calibrating
        if running is not None and not running.done:
            return Standing(State.BUSY, running.progress.text or "Calibrating")
        problem = self._camera().calibration_problem
        if not problem:
            return Standing(State.OK, "Pixels are positions on the platform", "Calibrate")
        advice = f"Bring the {self._tool()} into the image and close to the plate first"
        failed = running.failure if running is not None else None
        last = f"\nThe last calibration failed: {failed}" if failed is not None else ""
        return Standing(State.UNKNOWN, f"{problem}. {advice}{last}", "Calibrate")

    def calibrate(self) -> None:
        """Measure scale and rotation by moving the tool."""
        self._calibrating = self._rig.vico.calibrate_stage(self._tool(), self._camera().name)

    def cancel_calibration(self) -> None:
        """End the calibration; the tool stays where it is then."""
        _cancel(self._calibrating)

    def stage(self) -> Standing:
        """Look at what is known of the axes."""
        if self._check is not None and not self._check.done:
            return Standing(State.BUSY, self._check.progress.text or "Checking the axes")
        found = self._checking
        if found is None:
            return self._known_stage() or Standing(
                State.UNKNOWN,
                f"Moves the {self._tool()} to positions from both sides and looks at its tip; what "
                "is found is noted in the platform file",
                "Check axes",
            )
        if found.failure is not None:
            return Standing(State.ERROR, f"The last check failed: {found.failure}", "Check axes")
        return Standing(State.OK, f"{found.result.text}\n{self._report}", "Check axes")

    def _known_stage(self) -> Standing | None:
        """Return what the platform file has of the axes of the tool; None where it has nothing."""
        carrying = self._axes_of(self._tool())
        lines = [
            f"{each.name} repeats within {each.repeatability_um:.2f} µm, "
            f"backlash {each.backlash_um or 0.0:+.2f} µm"
            for each in self._gui.mico.settings.positioner
            if each.name in carrying and each.repeatability_um is not None
        ]
        if not lines:
            return None
        return Standing(State.OK, "\n".join([*lines, "As the platform file has it"]), "Check axes")

    def _axes_of(self, tool: str) -> tuple[str, ...]:
        try:
            return self._gui.mico.tools[tool].axes
        except CosmicError:  # without a scene nothing tells what carries it
            return ()

    def check_stage(self) -> None:
        """Begin to measure the axes of the tool by the camera."""
        transform = self._rig.vico.application.transform
        if not isinstance(transform, PlatformTransform):
            raise NotAvailable("axes are checked where camera and axes are in one program")
        self._report = ""
        self._check, self._checking = transform.check_stage(self._tool(), self._camera().name)
        self._checking.add_callback(self._keep)

    def cancel_check(self) -> None:
        """End the check of the axes; the tool stays where it is then."""
        _cancel(self._check)

    def _keep(self, found: Operation[StageReport]) -> None:
        if found.failure is not None:
            return
        try:
            path = self._folder() / f"axes-of-{found.result.tool}.toml"
            write_whole(path, found.result.toml)
        except OSError as exc:
            self._report = f"not kept: {exc}"
        else:
            self._report = f"written: {path}\n{self._note(found.result)}"

    def _note(self, report: StageReport) -> str:
        """Note what was found in the platform file; return what became of it."""
        if self._config is None:
            return "Not noted in a platform file: there is none of your own"
        try:
            note_axes(self._config, report, f"{datetime.now().astimezone():%Y-%m-%d}")
        except (ConfigError, OSError) as exc:
            return f"Not noted in the platform file: {exc}"
        return f"noted: {self._config}"

    def click(self) -> Standing:
        """Look at whether a click can move the tool."""
        problem = self._camera().calibration_problem
        if problem:
            return Standing(State.UNKNOWN, "After scale and rotation")
        return Standing(State.OK, f"Click into the image: the {self._tool()} goes there", "Try it")


def _cancel(running: Task | None) -> None:
    if running is not None:
        running.cancel()


class FirstDayPanel(QWidget):
    """Shows the steps with their buttons, as they stand now; GUI thread.

    Signals
    -------
    refused(str)
        A step could not begin; the text says why.
    """

    refused = Signal(str)

    def __init__(self, steps: Sequence[DayStep], parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setObjectName("firstDay")
        self.rows = {step.title: _Row(step, self, self._attempt) for step in steps}
        self.message = named(QLabel(), "firstDayMessage")
        self.message.setWordWrap(True)
        grid = QGridLayout()
        grid.setHorizontalSpacing(STEP_PX)
        grid.setVerticalSpacing(STEP_PX)
        for number, row in enumerate(self.rows.values()):
            for column, widget in enumerate((row.badge, row.title, row.text, row.button)):
                grid.addWidget(widget, number, column)
        grid.setColumnStretch(2, 1)
        whole = QVBoxLayout(self)
        whole.addLayout(grid)
        whole.addWidget(self.message)
        whole.addStretch(1)
        self._timer = QTimer(self, interval=LOOK_MS)
        self._timer.timeout.connect(self.refresh)

    def refresh(self) -> None:
        """Look at every step."""
        for row in self.rows.values():
            row.refresh()

    def _attempt(self, step: DayStep, act: Callable[[], object]) -> None:
        try:
            said = act()
        except CosmicError as exc:
            self.message.setText(f"{step.title}: {exc}")
            self.refused.emit(str(exc))
        else:
            self.message.setText(said if isinstance(said, str) else "")
        self.refresh()

    @override
    def showEvent(self, event: QShowEvent) -> None:
        super().showEvent(event)
        self.refresh()
        self._timer.start()

    @override
    def hideEvent(self, event: QHideEvent) -> None:
        super().hideEvent(event)
        self._timer.stop()


class _Row:
    """The widgets of one step."""

    def __init__(
        self,
        step: DayStep,
        owner: QWidget,
        attempt: Callable[[DayStep, Callable[[], object]], None],
    ) -> None:
        self._step, self._owner, self._attempt, self._act = step, owner, attempt, step.act
        self.badge = StateBadge()
        self.title = QLabel(step.title)
        self.text = QLabel()
        self.text.setWordWrap(True)
        self.button = push_button("", step.title)
        place = self.button.sizePolicy()
        place.setRetainSizeWhenHidden(True)  # no row moves while another one is clicked
        self.button.setSizePolicy(place)
        self.button.clicked.connect(lambda: self._attempt(step, self._act))

    def refresh(self) -> None:
        standing = self._step.look()
        self.badge.set_state(standing.state)
        text = with_micro_signs(standing.text)
        if self.text.text() != text:
            self.text.setText(text)
        busy = standing.state is State.BUSY
        cancel = self._step.cancel if busy else None
        self._act = self._step.act if cancel is None else cancel
        words = standing.button if cancel is None else "Cancel"
        set_shown(self.button, self._owner, shown=bool(words))
        if words and self.button.text() != words:
            self.button.setText(words)
        set_usable(self.button, self._owner, usable=cancel is not None or not busy)
