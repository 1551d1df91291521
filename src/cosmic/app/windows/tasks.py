"""The operator's window by task: six workspaces around one picture, with coach and drawer."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Final

from PySide6.QtCore import QObject, QSettings, QTimer
from PySide6.QtWidgets import QStackedWidget, QWidget

from cosmic.app.configuration.platform_file import platform_path
from cosmic.app.panels.alarms import AlarmBook, AlarmPanel, Level
from cosmic.app.panels.calibrations import CALIBRATIONS
from cosmic.app.panels.campaign.dock import CAMPAIGN, campaigns_folder, can_run
from cosmic.app.panels.coach import Coach, Rule
from cosmic.app.panels.first_day import DayStep, FirstDayPanel, FirstDaySteps
from cosmic.app.panels.force import ForcePanel
from cosmic.app.panels.history import HistoryPanel
from cosmic.app.panels.image_bar import ImageBar
from cosmic.app.panels.instruments import DAQCO, LENS, Instruments
from cosmic.app.panels.motion_tabs import CONTROL, TELEOPERATION, TRAJECTORIES
from cosmic.app.panels.recorded import RECORDER, RecorderPanel
from cosmic.app.panels.results.panel import ResultsPanel
from cosmic.app.panels.scene import ScenePanel
from cosmic.app.panels.tool import ToolPanel
from cosmic.app.platform import Platform
from cosmic.app.results.session_log import SessionLog
from cosmic.app.results.sessions import SessionFolder
from cosmic.app.rig import Rig
from cosmic.app.windows.alarm_watch import AlarmWatch, Quantity, computer_quantities
from cosmic.app.windows.central_view import SCENE_TITLE, CentralView, column_of
from cosmic.app.windows.fibre_menu import FibreOperations
from cosmic.app.windows.lens_start import LensStart
from cosmic.app.windows.picture_move import PictureMove
from cosmic.frame.failure import Failure
from cosmic.frame.gui.clearance_meter import closeness
from cosmic.frame.gui.late_panel import LatePanel
from cosmic.frame.gui.server_gui import CosmicServerGui
from cosmic.frame.gui.theme import STEP_PX
from cosmic.frame.gui.workspaces import Area, PanelPlacement, Workspace
from cosmic.frame.log import RingBufferHandler
from cosmic.mico.core.collision.model import SceneModel
from cosmic.mico.gui.mico_widget import MicoWidget
from cosmic.vico.gui.camera_view import CameraParts

if TYPE_CHECKING:
    from cosmic.autonomy.recorded.recorder import ProcedureRecorder

MICO: Final = "Axes"
TOOL: Final = "Tool"
FORCE: Final = "Force"
COACH: Final = "Next step"
IMAGE: Final = "Image"
CAMERA: Final = "Camera"
RESULTS: Final = "Results"
FIRST_DAY: Final = "First day"
ALARMS: Final = "Alarms"
HISTORY: Final = "History"

SET_UP: Final = "Set up"
LOOK: Final = "Look"
HANDLE: Final = "Handle"
MEASURE: Final = "Measure"

_LEFT: Final = Area.LeftDockWidgetArea
_RIGHT: Final = Area.RightDockWidgetArea
_FORMULA: Final = "force/calculated"
_COACH_PX: Final = 17 * STEP_PX
_WIDE_PX: Final = 49 * STEP_PX
WATCH_MS: Final = 500


def _left(title: str) -> PanelPlacement:
    return PanelPlacement(title, _LEFT, share=0.165, least_px=188, most_px=40 * STEP_PX)


def _right(title: str) -> PanelPlacement:
    return PanelPlacement(title, _RIGHT, share=0.195, least_px=212, most_px=50 * STEP_PX)


def _coach(below: str) -> PanelPlacement:
    return PanelPlacement(COACH, _RIGHT, below=below, height_px=_COACH_PX)


def workspaces(others: tuple[str, ...] = ()) -> tuple[Workspace, ...]:
    """Return the six workspaces, in order; `others` are titles of further panels in Set up."""
    return (
        Workspace(
            SET_UP,
            "Axes, devices, calibrations and configuration",
            (
                PanelPlacement(MICO, _LEFT, share=0.8),
                PanelPlacement(FIRST_DAY, _LEFT, tabbed=MICO),
                PanelPlacement(CALIBRATIONS, _LEFT, tabbed=MICO),
                PanelPlacement(DAQCO, _LEFT, tabbed=MICO),
                PanelPlacement(CONTROL, _LEFT, tabbed=MICO),
                *(PanelPlacement(title, _LEFT, tabbed=MICO) for title in others),
                _right(COACH),
            ),
        ),
        Workspace(
            LOOK,
            "Camera, lens, light, and measuring on the image",
            (_left(IMAGE), _right(LENS), _coach(LENS), PanelPlacement(CAMERA, _RIGHT, tabbed=LENS)),
            middle=True,
        ),
        Workspace(
            HANDLE,
            "Move one tool: pad, targets, poses, trajectories, gamepad",
            (
                _left(TOOL),
                PanelPlacement(TRAJECTORIES, _LEFT, tabbed=TOOL, least_px=_WIDE_PX, shown=False),
                PanelPlacement(RECORDER, _LEFT, tabbed=TOOL, least_px=_WIDE_PX, shown=False),
                PanelPlacement(TELEOPERATION, _LEFT, tabbed=TOOL, least_px=_WIDE_PX, shown=False),
                _right(FORCE),
                _coach(FORCE),
            ),
            middle=True,
        ),
        Workspace(
            MEASURE,
            "Force, its limit, and recordings",
            (_left(TOOL), _right(FORCE), _coach(FORCE)),
            middle=True,
        ),
        Workspace(
            CAMPAIGN,
            "Many fibres by one recipe",
            (PanelPlacement(CAMPAIGN, _LEFT, share=0.8), _right(COACH)),
        ),
        Workspace(RESULTS, "What was recorded", (PanelPlacement(RESULTS, _LEFT),)),
    )


class TaskLayout(QObject):
    """Makes what the workspaces need beside the panels there are, and joins them; GUI thread.

    Parameters
    ----------
    window : CosmicServerGui
        Where they are laid out.
    gui, scene : MicoWidget, ScenePanel
        The axes and the scene.
    instruments : Instruments
        Image and force.

    Attributes
    ----------
    campaigns : callable
        Returns where campaigns are looked for beside the folder of all.
    """

    campaigns: Callable[[], Path] = staticmethod(campaigns_folder)

    def __init__(
        self,
        window: CosmicServerGui,
        platform: Platform,
        rig: Rig,
        gui: MicoWidget,
        scene: ScenePanel,
        instruments: Instruments,
        settings: QSettings,
    ) -> None:
        super().__init__(window)
        self._window, self._platform, self._rig = window, platform, rig
        self._gui = gui
        images = instruments.images
        if images is None:
            raise ValueError("workspaces need a camera")
        self._images = images
        self.folder = SessionFolder()
        gui.offer_table()
        cameras = {view.windowTitle(): view for view in images.cameras.values()}
        self._parts = {title: view.give_parts() for title, view in cameras.items()}
        self.central_view = CentralView(cameras, scene)
        self._scene = scene
        self.bar = ImageBar(rig.vico, {title: each.exposure for title, each in self._parts.items()})
        self.central_view.set_bar(self.bar)
        self.tool = ToolPanel(gui)
        views = list(cameras.values())
        self._picture_move = PictureMove(rig, gui, self.tool, scene, views, self)
        self.operations: FibreOperations | None = None
        self.recorder: LatePanel[RecorderPanel] | None = None
        if can_run(platform):
            self.operations = FibreOperations(rig, self.central_view, scene, views, self)
            self.recorder = LatePanel(self._make_recorder)
            self.tool.offer_gently()
            self.tool.close_gently_requested.connect(self.operations.close_gently)
        self.force = self._force_panel(rig, gui) if instruments.force else None
        self.results = ResultsPanel(self._folders, platform.policy, self._model)
        self.first_day = FirstDayPanel(self._day_steps())
        self.book = AlarmBook(self)
        self._alarms = AlarmWatch(self.book, sound=platform.file.alarms.sound)
        self._computer = computer_quantities(platform.file.alarms, self.folder.home)
        self._log: SessionLog | None = None
        self._add_panels()
        others = tuple(each.title for each in platform.others.values())
        window.use_workspaces(workspaces(others), self.central_view)
        self._add_drawer()
        self._settings = settings
        self._formula_waits = False
        self._lens_start = LensStart(rig, self)
        self._connect()

    def _keep_images(self) -> None:
        """Have images go where all of the session goes, unless the platform names a directory."""
        named = self._platform.file.vico
        if named is not None and named.directory:
            return
        for parts in self._parts.values():
            if not parts.recorder.files.remote:
                parts.recorder.files.keep_in(self.folder.path, self.folder)

    def _force_panel(self, rig: Rig, gui: MicoWidget) -> ForcePanel:
        return ForcePanel(rig.daqco, gui, self.folder, running=lambda: rig.running)

    def _add_panels(self) -> None:
        self._keep_images()
        add = self._window.add_panel
        add(TOOL, self.tool, _LEFT, scroll=False)
        if self.recorder is not None:
            add(RECORDER, self.recorder, _LEFT, scroll=False)
        if self.force is not None:
            add(FORCE, self.force, _RIGHT, scroll=False)
        add(LENS, self._images.lens, _RIGHT, scroll=False)
        self._columns = {title: self._image_column(each) for title, each in self._parts.items()}
        self._image, self._camera = QStackedWidget(), QStackedWidget()
        for title, parts in self._parts.items():
            self._image.addWidget(self._columns[title])
            self._camera.addWidget(parts.settings)
        add(IMAGE, self._image, _LEFT, scroll=False)
        add(CAMERA, self._camera, _RIGHT)
        add(RESULTS, self.results, _LEFT, scroll=False)
        add(FIRST_DAY, self.first_day, _LEFT)

    def _make_recorder(self) -> RecorderPanel:
        """Make the panel of recorded procedures, and join it to what carries them out."""
        operations = self.operations
        assert operations is not None

        def watch() -> "ProcedureRecorder":
            from cosmic.autonomy.recorded.recorder import ProcedureRecorder

            return ProcedureRecorder(self._rig, operations.handling, lambda: operations.marked)

        tools = tuple(self.central_view.camera.camera.targets)
        own = self._platform.path
        panel = RecorderPanel(
            watch,
            lambda: ("platform", "fibre", "plate", *tools),
            self.folder,
            None if own == platform_path(None) else own.resolve(),
        )
        panel.replay_requested.connect(lambda found: operations.replay(found, self.folder))
        panel.continued.connect(operations.go_on)
        operations.waiting.connect(panel.show_waiting)
        panel.show_running(operations.title)
        operations.began.connect(panel.show_running)
        operations.ended.connect(lambda: panel.show_running(operations.title))
        operations.replay_wanted.connect(panel.request_replay)
        operations.offered = lambda: panel.procedure if panel.list.count() else None
        if self.force is not None:
            self.force.mark.clicked.connect(operations.go_on)
        return panel

    @staticmethod
    def _image_column(parts: CameraParts) -> QWidget:
        parts.gain.slider.hide()
        parts.exposure.show_field_only()
        return column_of(parts.row, parts.gain, parts.status, parts.recorder)

    def add_coach(self, rules: tuple[Rule, ...]) -> Coach:
        """Have a coach with these rules; before the workspaces are shown."""
        coach = Coach(rules, self._settings)
        dock = self._window.add_panel(COACH, coach, _RIGHT, scroll=False)
        made = self._window.workspaces
        if made is not None:
            made.add_dock(dock)
        return coach

    def keep_log(self, ring: RingBufferHandler) -> None:
        """Keep the log beside what is recorded, from the first recording on."""
        self._log = SessionLog(ring, self._platform.clock)
        self.folder.on_made = self._log.begin

    def shut_down(self) -> None:
        """End what goes on here; before the window goes."""
        self._watch.stop()
        if self.force is not None:
            calculation = self.force.calculated.calculation
            if calculation is not None or not self._formula_waits:
                self._settings.setValue(_FORMULA, calculation.formula if calculation else "")
        self.results.shut_down()
        if self._log is not None:
            self._log.close()

    def _add_drawer(self) -> None:
        drawer = self._window.drawer
        drawer.add_page(ALARMS, AlarmPanel(self.book), "Alarms: when, why, what to do")
        drawer.add_page(HISTORY, HistoryPanel(self._gui), "Movements that can be taken back")

    def _connect(self) -> None:
        central_view, bar, window = self.central_view, self.bar, self._window
        bar.camera_chosen.connect(central_view.show_large)
        bar.swap_requested.connect(central_view.swap)
        bar.fit_requested.connect(lambda: central_view.camera.view.fit())
        bar.inset_toggled.connect(central_view.set_inset_shown)
        bar.move_toggled.connect(self._on_move_toggled)
        self.tool.tool_chosen.connect(self._on_tool_chosen)
        bar.reported.connect(lambda text: central_view.camera.say(text))
        central_view.changed.connect(self._on_large_changed)
        self.book.changed.connect(self._on_alarms_changed)
        window.top_bar.alarms_clicked.connect(lambda: window.raise_panel(ALARMS))
        made = window.workspaces
        if made is not None:
            made.chosen.connect(self._on_workspace)
        if self.force is not None:
            self.force.written.connect(self._on_written)
            formula = str(self._settings.value(_FORMULA, ""))
            self.force.calculate(formula)
            # It may be that of another platform, or its channels may be away now.
            self._formula_waits = bool(formula) and self.force.calculated.calculation is None
            self.force.by_time.click()  # the force itself is what is looked at first
        self._gui.initialisation_begun.connect(self._lens_start.begin)
        self._lens_start.said.connect(window.drawer.line.set_text)
        self._watch = QTimer(self, interval=WATCH_MS)
        self._watch.timeout.connect(self.watch)
        self._watch.start()

    # Reactions

    def _on_move_toggled(self, on: bool) -> None:
        """Have the mouse move the chosen tool in both pictures, until that is put away."""
        view, name = self.central_view.camera, self.tool.tool.name
        self._scene.set_moving(on)
        if on and not view.camera.calibration_problem and name in view.camera.targets:
            view.row.target_chosen.emit(name)
        else:
            view.tools.put_away()
        self._show_move()

    def _on_tool_chosen(self, name: str) -> None:
        view = self.central_view.camera
        if view.tools.target and name in view.camera.targets:
            view.row.target_chosen.emit(name)
        elif view.tools.target:
            view.tools.put_away()
        self._show_move()

    def _show_move(self) -> None:
        view, name = self.central_view.camera, self.tool.tool.name
        in_scene = self.central_view.large == SCENE_TITLE
        problem = "" if in_scene else view.camera.calibration_problem
        if not problem and name not in view.camera.targets:
            problem = f"the {name} is not a tool that the image knows"
        on = self._scene.moving if in_scene else bool(view.tools.target)
        if not in_scene and not on:
            self._scene.set_moving(False)  # Escape has put the tool away
        self.bar.show_move(problem, name, on=on)

    def _on_large_changed(self, title: str) -> None:
        if title in self._columns:
            self._image.setCurrentWidget(self._columns[title])
            self._camera.setCurrentWidget(self._parts[title].settings)
            self.bar.show_camera(title)

    def _on_workspace(self, name: str) -> None:
        if name == RESULTS:
            self.results.refresh()

    def _on_written(self, path: object) -> None:
        if isinstance(path, Path):
            self._window.drawer.line.set_text(f"written: {path}")

    def _day_steps(self) -> tuple[DayStep, ...]:
        return FirstDaySteps(
            self._rig,
            self._gui,
            configured=tuple(self._platform.file.mico.kinds),
            force=self.force is not None,
            tool=self._tool_in_the_image,
            camera=lambda: self.central_view.camera.camera,
            folder=self.folder,
            click=self._try_click,
            config=self._platform.path,
        ).steps

    def _tool_in_the_image(self) -> str:
        """Return the chosen tool, or another one where that has no tip to be seen, as the table."""
        chosen, seen = self.tool.tool.name, tuple(self.central_view.camera.camera.targets)
        return chosen if chosen in seen or not seen else seen[0]

    def _try_click(self) -> None:
        """Show the image, with a click that moves the chosen tool."""
        if self._window.workspaces is not None:
            self._window.workspaces.choose(HANDLE)
        self._on_move_toggled(True)

    def _model(self) -> SceneModel | None:
        return self._gui.mico.application.scene

    def _folders(self) -> tuple[Path, ...]:
        """Return where recordings are looked for."""
        found = [self.folder.home, campaigns_folder(), self.campaigns()]
        if not self._force_remote():
            found.append(self._rig.daqco.directory)
        views = self._images.cameras.values()
        found += [each.camera.directory for each in views if not each.camera.remote]
        return tuple(dict.fromkeys(found))

    def _force_remote(self) -> bool:
        return self.force is None or bool(self._rig.daqco.remote)

    # Alarms

    def _on_alarms_changed(self) -> None:
        unseen = self.book.unseen
        newest = unseen[0].cause if unseen else ""
        self._window.top_bar.set_alarms(len(unseen), newest)

    def note_failure(self, failure: Failure) -> None:
        """Take a failure into the list of alarms."""
        advice = "Motion was stopped; look at the log" if failure.defect else "Look at the log"
        level = Level.CRITICAL if failure.defect else Level.WARNING
        self.book.raise_alarm(failure.where, level, f"{failure.where}: {failure.text}", advice)

    def show_stopped(self, reason: str | None) -> None:
        """Show everywhere that the stop is latched, and why; None: no longer."""
        self.tool.show_stopped(reason)

    def _quantities(self) -> dict[str, Quantity]:
        """Return what is watched by its value: forces with a limit, clearance, the computer."""
        settings = self._platform.file.alarms
        found = dict(self._computer)
        clearance = self._window.top_bar.clearance
        if clearance is not None:
            distance_um, between = clearance.distance_um, " and ".join(clearance.bodies)
            found["near"] = Quantity(
                "near",
                f"The clearance of {between}",
                "µm",
                settings.clearance_um,
                "Move them apart",
                lambda: distance_um,
            )
        for each in self._rig.daqco.limits if self.force is not None else ():
            name, value = each.settings.channel, each.value
            side = each.settings.high if value is None or value >= 0.0 else each.settings.low
            if not each.settings.armed or each.crossed or not side or value is None:
                continue
            share = abs(value / side)
            source = f"force {name}"
            found[source] = Quantity(
                source,
                f"{name}, of its limit,",
                "%",
                settings.force,
                "Move the tool back",
                partial(float, share),
                scale=100.0,
            )
        return found

    def _watch_margin(self) -> None:
        clearance = self._window.top_bar.clearance
        if clearance is not None and closeness(clearance) == "margin":
            one, other = clearance.bodies
            cause = f"{one} and {other} are at their margin, {clearance.figures} µm apart"
            self.book.raise_alarm("clearance", Level.WARNING, cause, "Move them apart")
        else:
            self.book.end("clearance")

    def watch(self) -> None:
        """Look at what raises alarms and is not told by itself."""
        self._show_move()
        self._picture_move.show_directions(self.central_view.camera)
        self._watch_margin()
        self._alarms.look(self._quantities())
        if self.force is not None:
            self._watch_force()

    def _watch_force(self) -> None:
        daqco, book = self._rig.daqco, self.book
        for each in daqco.limits:
            name = each.settings.channel
            if not each.crossed:
                book.end(f"limit {name}")
                continue
            unit = daqco.units.get(name, "")
            value = f" at {each.value:.4g} {unit}" if each.value is not None else ""
            advice = "Move the tool off, reset the stop, then reset the limit"
            book.raise_alarm(
                f"limit {name}", Level.CRITICAL, f"{name} crossed its limit{value}".rstrip(), advice
            )
        if daqco.problem:
            advice = "Check the board, then start the acquisition"
            book.raise_alarm("acquisition", Level.CRITICAL, daqco.problem, advice)
        else:
            book.end("acquisition")


def usable_by_task(gui: object, instruments: Instruments) -> bool:
    """Tell whether a window has what workspaces are laid out around: axes and a camera."""
    images = instruments.images
    return isinstance(gui, MicoWidget) and images is not None and bool(images.cameras)
