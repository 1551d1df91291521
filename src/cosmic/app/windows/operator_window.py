"""The operator's window: panels, stop, failures and the console around one platform."""

import logging
from typing import Final

from PySide6.QtCore import QObject, QSettings, Qt, QTimer, Signal
from PySide6.QtGui import QCloseEvent
from PySide6.QtWidgets import QApplication, QVBoxLayout, QWidget

import cosmic
from cosmic.app.panels.approvals import TITLE as APPROVALS_TITLE
from cosmic.app.panels.approvals import ApprovalsPanel
from cosmic.app.panels.calibrations import CalibrationPanel, add_calibrations
from cosmic.app.panels.campaign.dock import CAMPAIGN, CampaignDock, can_run
from cosmic.app.panels.instruments import DAQCO, LENS, instruments_of
from cosmic.app.panels.motion_tabs import TRAJECTORIES, MotionTabs
from cosmic.app.panels.path_preview import PathController, PathPreview, PreviewState
from cosmic.app.panels.scene import ScenePanel
from cosmic.app.platform import Platform
from cosmic.app.rig import Rig
from cosmic.app.stations.host import StationHost
from cosmic.app.windows.closing import Closing, Parking, what_is_lost
from cosmic.app.windows.coaching import coach_rules
from cosmic.app.windows.hint_bar import HintBar, first_steps
from cosmic.app.windows.station_controls import WindowStations
from cosmic.app.windows.tasks import (
    FORCE,
    HANDLE,
    IMAGE,
    MICO,
    TOOL,
    TaskLayout,
    usable_by_task,
)
from cosmic.app.windows.top_bar import ACM, ECM, SCM, CollisionBar, ControlMode, blocked_modes
from cosmic.daqco.api.daqco import daqco_of
from cosmic.daqco.gui.limit_indicator import LimitIndicator
from cosmic.frame.errors import CosmicError
from cosmic.frame.failure import Failure
from cosmic.frame.gui.console_panel import ConsolePanel
from cosmic.frame.gui.late_panel import LatePanel
from cosmic.frame.gui.log_panel import LogPanel
from cosmic.frame.gui.palette import ThemeName
from cosmic.frame.gui.relay import Relay
from cosmic.frame.gui.server_gui import LOG_TITLE, CosmicServerGui
from cosmic.frame.gui.stop_key import StopKeyFilter
from cosmic.frame.gui.theme import State
from cosmic.frame.log import RingBufferHandler
from cosmic.frame.overrides import override
from cosmic.mico.core.motion.stop_latch import StopState
from cosmic.mico.gui.mico_widget import MicoWidget

logger = logging.getLogger(__name__)


class WindowBridge(QObject):
    """Emits in the GUI thread what any thread reports; outlives the window, so nothing is lost."""

    failure_reported = Signal(object)

    def report_failure(self, failure: Failure) -> None:
        """Report a failure."""
        self.failure_reported.emit(failure)


CONSOLE: Final = "Console"
SCENE: Final = "Scene"
RATE_MS: Final = 1000
_SAID_MS: Final = 5000

_SHARES: Final = [3, 2]
"""How log and console share the width at a first start."""


class OperatorWindow(CosmicServerGui):
    """Hosts the panels of all applications of a platform; closing it closes the platform.

    The hardware is opened by `open_hardware`, after the window stands.

    Parameters
    ----------
    platform : Platform
        What it shows and commands, not yet initialised.
    settings : QSettings
        Where layout, theme and the dismissed hint are kept.
    ring : RingBufferHandler
        Where the log panel takes its records from.
    console : bool
        Have a Python console.
    host : StationHost or None
        What serves the platform to others; closed with the window.
    """

    def __init__(
        self,
        platform: Platform,
        settings: QSettings,
        ring: RingBufferHandler,
        *,
        console: bool = True,
        theme: ThemeName = "dark",
        host: StationHost | None = None,
    ) -> None:
        stop_key = platform.file.platform.stop_key
        super().__init__(settings, stop_key=stop_key, theme=theme)
        self.setWindowTitle(f"CoSMic: {platform.file.platform.name}")
        self._platform, self._host = platform, host
        self._rig = Rig(platform, source="window")
        self._mico = None if platform.mico is None else self._rig.mico
        self._console: ConsolePanel | None = None
        self._motion_tabs: MotionTabs | None = None
        self._mico_gui: MicoWidget | None = None
        self._scene: ScenePanel | None = None
        self._path: PathController | None = None
        self._closing = Closing(self._what_is_lost, self)
        self._parking: Parking | None = None
        self._bridge = WindowBridge()
        self._stop_shown, self._stops = StopState(reason=None, epoch=0), Relay(self._on_latch)
        self._tasks: TaskLayout | None = None
        self._forget_policy = platform.policy.subscribe(self._bridge.report_failure)
        self._instruments = instruments_of(platform)
        gui = platform.mico.get_gui() if platform.mico is not None else None
        self._by_task = usable_by_task(gui, self._instruments)
        self._add_mico(settings)
        images = self._add_instruments()
        self._campaign: CampaignDock | None = None
        self._calibrations: LatePanel[CalibrationPanel] | None = None
        self._add_procedures()
        if images:
            self.dock(images).raise_()
        self._add_others()
        self._lay_out_by_task(settings)
        self._stations = WindowStations(self, platform, host, self._panels_by_application())
        model = self._mico_gui is not None and self._mico_gui.collision.has_model
        blocked = blocked_modes(
            mico=self._mico_gui is not None, model=model, campaigns=self._campaign is not None
        )
        self._mode = ControlMode(self.top_bar, settings, blocked, self)
        self._mode.changed.connect(self._on_mode_changed)
        self._mode.restore()
        self._add_approvals()
        self._add_log(ring, console=console)
        # Last, for it sees every event: some ten thousand while the panels are made.
        self._stop_filter = StopKeyFilter(_application(), stop_key, self, moving=self._is_moving)
        self._connect_all()
        self._show_platform()

    # Putting it together

    def _add_mico(self, settings: QSettings) -> None:
        application = self._platform.mico
        gui = application.get_gui() if application is not None else None
        if application is None or not isinstance(gui, MicoWidget):
            return
        stop_key = self._platform.file.platform.stop_key
        panel = QWidget()
        column = QVBoxLayout(panel)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(0)
        column.addWidget(HintBar(first_steps(gui.mico.settings, stop_key), settings))
        column.addWidget(gui, 1)
        self.add_panel(MICO, panel, Qt.DockWidgetArea.LeftDockWidgetArea, scroll=False)
        self._mico_gui = gui
        gui.failure_changed.connect(self._on_mico_failure)
        self._stops.keep(gui.mico.follow_stop(self._note_latch))
        self._scene = ScenePanel(gui, settings)
        if not self._by_task:
            right = Qt.DockWidgetArea.RightDockWidgetArea
            self.add_panel(SCENE, self._scene, right, scroll=False)
        gui.undo_planned.connect(self._scene.set_planned)
        gui.ask_while(self._what_runs)
        gui.refuse_while(self._what_drives)
        gui.busy_refused.connect(self._on_busy_refused)
        self._parking = Parking(gui, self._is_moving, self)
        self._parking.failed.connect(lambda why: self.top_bar.set_message(f"not parked: {why}"))
        for asking in (self._closing, self._parking):
            asking.given_up.connect(self._closing.forget)
            asking.given_up.connect(self._parking.forget)
        self._collision_bar = CollisionBar(self.top_bar, gui, self)
        preview = PathPreview()
        self._scene.set_bar(preview)
        self._path = PathController(gui, self._scene, preview, self)
        self._path.offered.connect(self._raise_scene)

    def _add_instruments(self) -> str:
        """Put image and lens in the middle, force below the scene; return the image's title."""
        if self._platform.mico is None:
            self.top_bar.set_collision_model(present=True)  # nothing moves that could collide
        if self._by_task:
            self._instruments.add_force(self)
            return ""
        if self._platform.daqco is not None:
            self.top_bar.add_indicator(LimitIndicator(daqco_of(self._platform.daqco)))
        scene = SCENE if self._scene is not None else ""
        return self._instruments.place(self, scene, MICO if scene else "")

    def _add_others(self) -> None:
        """Put applications of other packages beside the scene, as far as they have a widget."""
        docked = self._scene is not None and not self._by_task
        for application in self._platform.others.values():
            gui = application.get_gui()
            if isinstance(gui, QWidget):
                self.add_panel(application.title, gui, beside=SCENE if docked else "")
        if docked and self._platform.others:
            self.dock(SCENE).raise_()

    def _add_approvals(self) -> None:
        """Add what programs want to move, where a person has to approve it."""
        host = self._host
        if host is not None and host.asks_first:
            panel = ApprovalsPanel(host.approvals)
            self.closing.connect(panel.end)
            if self._tasks is None:
                self.add_panel(APPROVALS_TITLE, panel)
                return
            self.drawer.add_page(APPROVALS_TITLE, panel, "What other programs want to move")
            panel.asked.connect(lambda: self.drawer.show_page(APPROVALS_TITLE))

    def _add_procedures(self) -> None:
        """Add what moves by itself: trajectories, loops, calibrations, campaigns."""
        if self._mico_gui is None or self._scene is None:
            return
        beside = MICO if self._by_task else SCENE
        self._motion_tabs = MotionTabs(
            self, self._mico_gui, self._scene, self._rig.control, beside=beside
        )
        if not can_run(self._platform):
            return
        self._campaign = CampaignDock(
            self, self._rig, self._scene, self._platform.policy, beside=MICO
        )
        self._campaign.replayed.connect(self._raise_scene)
        if self._host is not None:
            self._host.use_rig(self._rig.commanding_as("station"))
        self._calibrations = add_calibrations(self, self._rig, beside=MICO)
        self.dock(MICO).raise_()

    def _lay_out_by_task(self, settings: QSettings) -> None:
        """Have the six workspaces, where there are axes and a camera."""
        if not self._by_task or self._mico_gui is None or self._scene is None:
            return
        self._tasks = TaskLayout(
            self,
            self._platform,
            self._rig,
            self._mico_gui,
            self._scene,
            self._instruments,
            settings,
        )
        campaign = self._campaign
        if campaign is not None:
            self._tasks.campaigns = lambda: campaign.home
            if self._tasks.operations is not None:
                campaign.opened.connect(self._tasks.operations.close_card)
        self._tasks.add_coach(
            coach_rules(self, self._rig, self._mico_gui, self._tasks, self._campaign)
        )
        if self._platform.daqco is not None:
            indicator = LimitIndicator(daqco_of(self._platform.daqco), compact=True)
            self.top_bar.add_indicator(indicator)

    def _panels_by_application(self) -> dict[str, list[str]]:
        if self._tasks is None:
            return self._instruments.panels
        daqco = [DAQCO] if self._tasks.force is None else [DAQCO, FORCE]
        return {"daqco": daqco, "vico": [LENS, IMAGE]}

    def _add_log(self, ring: RingBufferHandler, *, console: bool) -> None:
        below = Qt.DockWidgetArea.BottomDockWidgetArea
        if self._tasks is not None:
            self.drawer.add_page(LOG_TITLE, LogPanel(ring), "What happened, line by line")
            self._tasks.keep_log(ring)
        else:
            self.add_panel(LOG_TITLE, LogPanel(ring), below, scroll=False)
        if console:
            self._console = ConsolePanel(
                self._platform.policy,
                {"rig": self._rig.commanding_as("console"), "cosmic": cosmic},
                on_interrupt=self.halt_all,
                banner='Python console: try rig.mico["left.x"].move_by("0.2 mm"). '
                "Ctrl+C or Interrupt breaks what runs.\n",
            )
            if self._tasks is not None:
                self.drawer.add_page(CONSOLE, self._console, "The platform from Python")
                return
            self.add_panel(CONSOLE, self._console, scroll=False, beside=LOG_TITLE)
            self.share_out((LOG_TITLE, CONSOLE), _SHARES, Qt.Orientation.Horizontal)

    def _connect_all(self) -> None:
        self.stop_requested.connect(self._on_stop_button)
        self._stop_filter.stop_requested.connect(self._on_stop_key)
        self._stop_filter.add_cancel(self._cancel_path)
        self._stop_filter.add_cancel(self._cancel_tool)
        if self._tasks is not None:
            self._stop_filter.add_cancel(self.drawer.close_page)
        self.top_bar.reset_requested.connect(self._on_reset)
        self.top_bar.message_clicked.connect(self._on_message_read)
        self.rescan_requested.connect(self._on_rescan)
        self.closing.connect(self._on_closing)
        self._bridge.failure_reported.connect(self._on_failure)

    def _show_platform(self) -> None:
        bar, platform = self.top_bar, self._platform
        bar.set_simulated(platform.simulated)
        self._show_rate()
        looks = QTimer(self, interval=RATE_MS)
        looks.timeout.connect(self._show_rate)
        looks.start()
        stop_key = platform.file.platform.stop_key
        keys = [
            (stop_key, "stop every movement and keep it stopped, from anywhere"),
            ("Esc", "cancel a menu, dialog, entry or tool; otherwise stop what moves"),
        ]
        if self._mico_gui is not None:
            keys += self._mico_gui.keys()
        keys += [("F1", "this list"), ("Ctrl+Q", "close")]
        self.set_keys(keys)
        self.set_about(
            f"CoSMic {cosmic.__version__}\nControl software for a microrobotic platform.\n"
            f"Platform file: {platform.path}" + (f"\n{self._host.address}" if self._host else "")
        )

    def _show_rate(self) -> None:
        clock = self._platform.clock
        self.top_bar.set_rate(clock.rate, clock.rate_reached if self._platform.simulated else None)

    @property
    def platform(self) -> Platform:
        """What it shows and commands."""
        return self._platform

    @property
    def mico_gui(self) -> MicoWidget | None:
        """The MiCo panel, where MiCo is hosted."""
        return self._mico_gui

    @property
    def scene_panel(self) -> ScenePanel | None:
        """The panel with the scene, where MiCo is hosted."""
        return self._scene

    @property
    def motion_tabs(self) -> MotionTabs | None:
        """Trajectories, teleoperation and control loops, where MiCo is hosted."""
        return self._motion_tabs

    @property
    def tasks(self) -> TaskLayout | None:
        """What the workspaces are made of; None in a window of docks alone."""
        return self._tasks

    @override
    def raise_panel(self, title: str) -> None:
        """Show the panel `title`, or that picture, and bring it to the front."""
        central_view = self._tasks.central_view if self._tasks is not None else None
        if central_view is None or self.workspaces is None or title not in central_view.titles:
            super().raise_panel(title)
            return
        shown = {each.name: each for each in self.workspaces.all}[self.workspaces.current]
        if not shown.middle:
            self.workspaces.choose(HANDLE)
        central_view.show_large(title)

    @property
    def mode(self) -> str:
        """The control mode in force: MCM, SCM, ECM or ACM."""
        return self._mode.mode

    @property
    def console(self) -> ConsolePanel | None:
        """The console, where there is one."""
        return self._console

    # Running

    def open_hardware(self) -> None:
        """Begin to open the hardware; the panels show how it goes."""
        self.setFocus()  # else the first button has it, and Space would press that
        self._platform.initialize_later()

    def stop(self, reason: str) -> None:
        """Stop everything and keep it stopped."""
        if self._mico is not None:
            self._mico.stop(reason)  # which stops outputs as well
        elif self._platform.daqco is not None:
            daqco = daqco_of(self._platform.daqco)
            daqco.carry_out(lambda: daqco.stop_outputs(reason), self._on_outputs_stopped)

    def _on_outputs_stopped(self, _result: None, error: CosmicError | None) -> None:
        if error is not None:
            self._platform.policy.report(error, "stop of the outputs")

    def halt_all(self) -> None:
        """Stop the axes that move, without latching; any thread."""
        if self._mico_gui is None:
            return
        mico = self._mico_gui.mico
        for name, state in mico.states().items():
            if state.in_motion:
                mico[name].halt()

    def _what_runs(self) -> str:
        """Return what moves axes by itself, as a reason not to move them under it."""
        running = self._rig.running
        return f"{running} is running and moves axes itself" if running else ""

    def _what_drives(self) -> str:
        """Return what moves axes just now, as a reason to move nothing by hand; any thread."""
        operations = self._tasks.operations if self._tasks is not None else None
        if operations is not None and operations.waits:  # a replay has the operator do something
            return ""
        driving = self._rig.driving
        return f"{driving} moves the axes; end or pause it first" if driving else ""

    def _on_busy_refused(self, why: str) -> None:
        """Say why a key moved nothing where it is seen in every workspace, for a while."""
        self.top_bar.set_message(why, State.REFUSED)
        QTimer.singleShot(_SAID_MS, self, lambda: self._forget_message(why))

    def _forget_message(self, text: str) -> None:
        if self.top_bar.message == text:
            self.top_bar.set_message("")

    def _is_moving(self) -> bool:
        """Tell whether Escape has something to stop."""
        campaign = self._campaign is not None and self._campaign.running
        operations = self._tasks.operations if self._tasks is not None else None
        campaign = campaign or (operations is not None and operations.running)
        mico = self._mico
        if campaign or mico is None or not mico.ready:
            return campaign
        task = mico.application.running_task
        return (task is not None and not task.done) or any(
            state.in_motion for state in mico.states().values()
        )

    def _cancel_tool(self) -> bool:
        """Put the tools on the images away, as Escape does first."""
        images = self._instruments.images
        views = list(images.cameras.values()) if images is not None else []
        chosen = [each for each in views if each.isVisible() and each.view.tool is not None]
        for each in chosen:
            each.tools.put_away()
        return bool(chosen)

    def _cancel_path(self) -> bool:
        """Leave a detour that is looked for or offered; one that is being driven is stopped."""
        path = self._path
        if path is None or path.state not in (PreviewState.PLANNING, PreviewState.FOUND):
            return False
        path.cancel()
        return True

    def _on_stop_button(self) -> None:
        self.stop("STOP button")

    def _on_stop_key(self, key: str) -> None:
        self.stop(f"key {key}")

    def _on_reset(self) -> None:
        if self._mico is not None:
            self._mico.reset_stop()

    def _note_latch(self, _state: StopState) -> None:
        self._stops()

    def _on_latch(self) -> None:
        """Show what is so now: a window that is slow skips what was reset meanwhile."""
        if self._mico is None or self._mico.stop_state == self._stop_shown:
            return
        state = self._mico.stop_state
        stopped_since = state.epoch != self._stop_shown.epoch
        self._stop_shown = state
        self.top_bar.set_latched(state.reason)
        if self._mico_gui is not None:
            self._mico_gui.release_keys()
            self._mico_gui.show_stopped(state.reason)
        if self._tasks is not None:
            self._tasks.show_stopped(state.reason)
        if self._path is not None and stopped_since:
            self._path.cancel()

    def _on_mode_changed(self, mode: str) -> None:
        if self._mico_gui is None or self._path is None:
            return
        self._mico_gui.set_planning_detours(mode == ECM)
        panel = {SCM: TRAJECTORIES, ACM: CAMPAIGN}.get(mode)
        if panel is not None:
            self.raise_panel(panel)
        if self._path.state is not PreviewState.MOVING:
            self._path.cancel()

    def _raise_scene(self) -> None:
        self.raise_panel(SCENE)

    def _on_failure(self, failure: Failure) -> None:
        self.top_bar.set_message(f"{failure.where}: {failure.text}", State.ERROR)
        if self._tasks is not None:
            self._tasks.note_failure(failure)

    def _on_mico_failure(self, reason: str) -> None:
        panels = (MICO, TOOL) if self._tasks is not None else (MICO,)
        if reason:
            for title in panels:
                self.set_failed(title, reason)
            self.top_bar.set_message(f"{MICO}: {reason}", State.ERROR)
        elif self.dock(MICO).failure:
            for title in panels:
                self.clear_failed(title)
            self.top_bar.set_message("")

    def _on_message_read(self) -> None:
        self.top_bar.set_message("")

    def _on_rescan(self, title: str) -> None:
        if title in (MICO, TOOL) and self._mico_gui is not None:
            self._mico_gui.rescan()

    def close_now(self) -> None:
        """Close without a question, as when the system ends the program."""
        self._closing.skip()
        if self._parking is not None:
            self._parking.skip()
        self.close()

    def _what_is_lost(self) -> tuple[str, ...]:
        operations = self._tasks.operations if self._tasks is not None else None
        daqco = self._platform.daqco
        force = daqco is not None and not daqco_of(daqco).remote
        return what_is_lost(self._rig, operations, force=force)

    @override
    def closeEvent(self, event: QCloseEvent) -> None:
        if self._closing.asks() or (self._parking is not None and self._parking.asks()):
            event.ignore()
            return
        super().closeEvent(event)

    def _on_closing(self) -> None:
        """Leave everything safe; motion ends first, the console with what it waits for next."""
        if self._host is not None:
            self._host.close()
        self._stations.end()
        self._forget_policy()
        if self._scene is not None:
            self._scene.save()
        if self._mico_gui is not None:
            self._mico_gui.release_keys()
        if self._campaign is not None:
            self._campaign.shut_down()
        if self._calibrations is not None and self._calibrations.made is not None:
            self._calibrations.made.shut_down()
        if self._motion_tabs is not None:
            self._motion_tabs.shut_down()
        if self._tasks is not None:
            self._tasks.shut_down()
        self._rig.close()
        if self._console is not None:
            self._console.shut_down()


def _application() -> QApplication:
    app = QApplication.instance()
    if not isinstance(app, QApplication):
        raise TypeError("a window needs a QApplication")
    return app
