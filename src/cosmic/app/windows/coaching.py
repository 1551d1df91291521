"""What the coach of the operator's window proposes, the most urgent first."""

from collections.abc import Callable
from typing import Final, Protocol

from cosmic.app.panels.campaign.dock import CampaignDock
from cosmic.app.panels.coach import Rule, Step
from cosmic.app.panels.force import ForcePanel
from cosmic.app.panels.tool import ToolPanel
from cosmic.app.rig import A_CAMPAIGN, Rig
from cosmic.app.windows.central_view import CentralView
from cosmic.app.windows.fibre_menu import FibreOperations
from cosmic.daqco.core.settings import LimitSettings
from cosmic.frame.errors import CosmicError
from cosmic.frame.gui.server_gui import CosmicServerGui
from cosmic.mico.core.motion.positioner import Confidence
from cosmic.mico.core.sequence.report import StepState
from cosmic.mico.gui.mico_widget import MicoWidget
from cosmic.mico.hw.interface import PositionerKind
from cosmic.vico.hw.peripherals import LensAxis

ZOOMED_IN: Final = 1.05
"""Beyond so many times the least zoom not all of the plate is seen."""


class Parts(Protocol):
    """What of the workspaces the rules look at."""

    central_view: CentralView
    tool: ToolPanel
    force: ForcePanel | None
    operations: FibreOperations | None


def coach_rules(
    window: CosmicServerGui,
    rig: Rig,
    gui: MicoWidget,
    parts: Parts,
    campaign: CampaignDock | None = None,
) -> tuple[Rule, ...]:
    """Return the rules of a window: trouble first, then what is missing, then the task in hand."""
    rules = _Rules(window, rig, gui, parts, campaign)
    first = (rules.not_ready, rules.stopped, rules.limit_crossed, rules.campaign)
    missing = (
        rules.initialising,
        rules.position_unknown,
        rules.lens_unknown,
        rules.camera_stopped,
        rules.nothing_acquired,
        rules.disarmed,
    )
    return (*first, *missing, rules.fibre, rules.task)


class _Rules:
    """Each looks at one thing and returns what to do about it, or None."""

    def __init__(
        self,
        window: CosmicServerGui,
        rig: Rig,
        gui: MicoWidget,
        parts: Parts,
        dock: CampaignDock | None,
    ) -> None:
        self._window, self._rig, self._gui, self._parts = window, rig, gui, parts
        self._dock = dock

    def _try(self, act: Callable[[], object]) -> Callable[[], None]:
        def attempt() -> None:
            try:
                act()
            except CosmicError as exc:
                self._window.top_bar.set_message(str(exc))

        return attempt

    def not_ready(self) -> Step | None:
        """Look for the axes."""
        mico = self._gui.mico
        if mico.failure:
            text = f"The axes cannot be used: {mico.failure}. Check power and cable, then rescan."
            return Step(text, "Rescan", self._gui.rescan)
        return None if mico.ready else Step("The devices are being opened; this takes a moment.")

    def stopped(self) -> Step | None:
        """Look at the stop."""
        reason = self._rig.stopped
        if reason is None:
            return None
        text = f"Motion is stopped ({reason}). Look at the tool, then allow movements again."
        return Step(text, "Reset", self._try(self._rig.reset_stop))

    def limit_crossed(self) -> Step | None:
        """Look at the limits."""
        if self._parts.force is None:
            return None
        daqco = self._rig.daqco
        crossed = next((each for each in daqco.limits if each.crossed), None)
        if crossed is None:
            return None
        name = crossed.settings.channel
        text = f"The {name} crossed its limit. Move the tool off, then reset the limit."
        return Step(text, "Reset limit", self._try(lambda: daqco.reset_limit(name)))

    def initialising(self) -> Step | None:
        """Look whether the axes are just driven to their references."""
        steps = self._gui.mico.initialisation.steps
        if all(each.state is not StepState.RUNNING for each in steps):
            return None
        return Step("The axes are being initialised. STOP ends it at once.")

    def position_unknown(self) -> Step | None:
        """Look at what is known of the positions."""
        unknown = [
            axis.key
            for axis in self._gui.mico
            if axis.kind is not PositionerKind.OPEN_LOOP
            and axis.details.present
            and axis.details.confidence is Confidence.UNKNOWN
        ]
        if not unknown:
            return None
        named = unknown[0] if len(unknown) == 1 else f"{len(unknown)} axes"
        text = f"The position of {named} is unknown. Initialise finds the references."
        return Step(text, "Initialise", self._gui.initialise)

    def campaign(self) -> Step | None:
        """Look whether a campaign works: what seems to be missing then is its own business."""
        if self._rig.running != A_CAMPAIGN:
            return None
        if self._dock is not None and self._dock.request:
            text = f"The campaign waits for a person: {self._dock.request}."
            return Step(text, "Plate is there", self._dock.confirm_plate)
        if self._dock is not None and self._dock.paused:
            text = "The campaign is paused and does nothing until Resume. Abort ends it safely."
            return Step(text, "Resume", self._dock.resume)
        text = "A campaign runs. It arms the force limit itself while the probe is out. "
        return Step(text + "Abort leaves things safe; STOP stops at once.")

    def lens_unknown(self) -> Step | None:
        """Look at the lens."""
        lens = self._rig.vico.lens
        if lens is None or lens.problem:
            return None
        states = [lens.state(axis) for axis in LensAxis]
        if all(state is not None and (state.homed or state.moving) for state in states):
            return None
        text = "The lens does not know its zoom and focus yet. Home both motors."
        return Step(text, "Home lens", self._try(lens.home))

    def camera_stopped(self) -> Step | None:
        """Look at the camera shown."""
        camera = self._parts.central_view.camera.camera
        if camera.running or camera.problem:
            return None
        return Step(
            "The camera is stopped. Start it to see the tools.",
            "Start camera",
            self._try(camera.start),
        )

    def nothing_acquired(self) -> Step | None:
        """Look at the acquisition."""
        if self._parts.force is None or self._rig.daqco.running or self._rig.daqco.away:
            return None
        text = "The force is not measured, so no limit protects the probe. Start the acquisition."
        return Step(text, "Start", self._try(self._rig.daqco.start))

    def disarmed(self) -> Step | None:
        """Look for limits that watch nothing."""
        if self._parts.force is None:
            return None
        daqco = self._rig.daqco
        off = next((each for each in daqco.limits if not each.settings.armed), None)
        if off is None or off.reason:
            return None
        limit: LimitSettings = off.settings.model_copy(update={"armed": True})
        text = f"The limit of {limit.channel} is disarmed; the probe can break. Arm it."
        return Step(text, "Arm limit", self._try(lambda: daqco.set_limit(limit)))

    def fibre(self) -> Step | None:
        """Look at the fibre that is held, or at how to come to one."""
        spaces, operations = self._window.workspaces, self._parts.operations
        if operations is None or spaces is None or spaces.current not in ("Handle", "Measure"):
            return None
        if operations.running:
            return Step("The operation runs; its card is on the image. Escape or STOP stops it.")
        request = operations.next_request()
        if request is not None:
            handling = operations.handling
            text = f"The {handling.held_by} gripper holds a fibre. {request.title} comes next."
            if handling.may_hold:
                text = (
                    f"The {handling.may_hold} gripper was opened since it took the fibre: whether "
                    "it still holds it is not known. Put away looks at the jaws."
                )
            return Step(text, request.title, lambda: operations.begin(request))
        if spaces.current != "Handle":
            return None
        if operations.worked and not operations.failed:
            return None
        return self._choose_fibre(operations)

    def _choose_fibre(self, operations: FibreOperations) -> Step:
        """Come to a fibre that can be clicked: found, in sight, chosen."""
        view, failed = self._parts.central_view.camera, operations.failed
        if not operations.finding(view):
            text = "To take a fibre, have the fibres found, then right-click one in the image."
            return Step(text, "Find fibres", lambda: operations.find(view, on=True))
        if self._zoomed_in():
            why = f"{failed} did not succeed." if failed else "Fibres are taken in the whole view."
            text = f"{why} Zoom out, then right-click a fibre outlined in green."
            return Step(text, "Zoom out", self._try(self._zoom_out))
        if failed:
            text = f"{failed} did not succeed; its card says why. Right-click a fibre "
            return Step(text + "outlined in green to try again.")
        return Step("Right-click a fibre outlined in green to take it with a gripper.")

    def _least_zoom(self) -> float | None:
        lens = self._rig.vico.lens
        if lens is None or lens.problem:
            return None
        return next((each.zoom for each in lens.steps), None)

    def _zoomed_in(self) -> bool:
        lens, least = self._rig.vico.lens, self._least_zoom()
        zoom = lens.zoom if lens is not None else None
        return zoom is not None and least is not None and zoom > ZOOMED_IN * least

    def _zoom_out(self) -> None:
        lens, least = self._rig.vico.lens, self._least_zoom()
        if lens is not None and least is not None:
            lens.zoom_to(least)

    def task(self) -> Step | None:
        """Propose what the workspace in front is for."""
        spaces = self._window.workspaces
        words = {
            "Set up": self._set_up,
            "Look": self._look,
            "Handle": self._handle,
            "Measure": self._measure,
            "Campaign": self._campaign,
        }
        found = words.get(spaces.current if spaces is not None else "")
        return found() if found is not None else None

    def _go(self, workspace: str) -> Callable[[], None]:
        def go() -> None:
            if self._window.workspaces is not None:
                self._window.workspaces.choose(workspace)

        return go

    def _set_up(self) -> Step:
        steps = self._gui.mico.initialisation.steps
        failed = next((each for each in steps if each.state is StepState.FAILED), None)
        if failed is not None:
            text = (
                f'The initialisation ended early, at "{failed.title}": not every axis is ready. '
                "Look at the tools, then initialise again."
            )
            return Step(text, "Initialise", self._gui.initialise)
        return Step("All axes are ready. Look at the plate next.", "Look", self._go("Look"))

    def _look(self) -> Step:
        camera = self._parts.central_view.camera.camera
        problem = camera.calibration_problem
        if problem and camera.calibrated:
            text = (
                f"Not calibrated for what lies on the plate: {problem}. Bring a tool down to about "
                "50 µm above the plate, at this zoom, and Calibrate again; or take a fibre in "
                "Handle, which calibrates by itself."
            )
            return Step(text, "Handle", self._go("Handle"))
        if problem:
            text = (
                "To take a fibre, go on to Handle. Click-to-move needs a calibration: Calibrate, "
                "at the left."
            )
            return Step(text, "Handle", self._go("Handle"))
        return Step("The image is calibrated. Choose a tool next.", "Handle", self._go("Handle"))

    def _handle(self) -> Step:
        tool = self._parts.tool.tool.name
        text = f"The pad moves the {tool} by the step. Take the force of a fibre in Measure."
        return Step(text, "Measure", self._go("Measure"))

    def _measure(self) -> Step | None:
        force = self._parts.force
        if force is None:
            return None
        if self._rig.daqco.recording.active:
            text = "Recording. Push with the pad in small steps, then stop the recording."
            return Step(text, "Stop recording", force.record.click)
        return Step(
            "Name the recording and press Record, then push with the pad.",
            "Record",
            force.record.click,
        )

    def _campaign(self) -> Step:
        dock = self._dock
        if dock is not None and dock.unfinished:
            text = "The campaign has ended early. Resume goes on with it; Start begins a new one."
            return Step(text, "Resume", dock.resume)
        if dock is not None and dock.finished:
            text = "The campaign is finished. Look at its report; Start begins a new one."
            return Step(text, "Report", dock.show_report)
        return Step("Choose a recipe and a folder, then press Start.")
