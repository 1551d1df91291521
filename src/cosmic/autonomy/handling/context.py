"""`HandlingContext`: what the operations of one gripper share, and what grippers share."""

import math
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Final, Protocol

from typing_extensions import override

from cosmic.autonomy.bending.fit import Refits
from cosmic.autonomy.calibrating.registry import CalibrationRegistry
from cosmic.autonomy.coordinate_transform import NO_TABLE, PlatformTransform
from cosmic.autonomy.handling.force import ForceWatch
from cosmic.autonomy.handling.held_fibre import HeldFibre
from cosmic.autonomy.handling.plate import Candidate, Jaws, PlateFrame
from cosmic.autonomy.handling.plate_obstacles import plate_obstacles
from cosmic.autonomy.handling.retrying_move import RetryingMove, return_movement
from cosmic.autonomy.handling.settings import HandlingSettings, of_arm
from cosmic.autonomy.handling.sight import LastSeen, LiveImage, map_at
from cosmic.autonomy.procedures.failures import failure_of
from cosmic.autonomy.procedures.operation import OperationFailed, Steps, UnitOperation
from cosmic.autonomy.procedures.waits import Resource
from cosmic.autonomy.tools import axis_targets
from cosmic.daqco.api.daqco import Daqco
from cosmic.frame.arrays import Floats
from cosmic.frame.clock import Clock
from cosmic.frame.errors import ConfigError, CosmicError, NotAvailable
from cosmic.mico.api.mico import Mico, mico_of
from cosmic.vico.api.application import VicoApplication
from cosmic.vico.api.vico import Vico
from cosmic.vico.core.image import CameraImage
from cosmic.vico.core.pixel_map import PixelMap
from cosmic.vico.core.tool_settings import ToolSettings

HEIGHTS: Final = "heights over the plate"
BIN_ASIDE_UM: Final = 5000.0
"""Where a clip of the plate stands in the bin, fibres are put away so far beside it."""


def _never() -> bool:
    return False


@dataclass(slots=True, eq=False)
class SharedWorkspace:
    """What all arms share; belongs to the thread of the run.

    Attributes
    ----------
    candidates : list of Candidate
        Of the last survey, less those that were taken; on the plate.
    skipped : list of Candidate
        Those on which grasping failed: they are not tried a second time.
    standard : Candidate or None
        The standard, where the last survey has seen it free.
    dropped : list of HeldFibre
        Those that were measured, and fell on the way to the bin: they lie on the plate again.
    unsuitable : list of Candidate
        Those of the last survey that are not taken, each with its problem.
    skip_reasons : Counter of str
        Why fibres of the last survey are not taken, and how many.
    finished : list of HeldFibre
        Those that were put away.
    refits : Refits
        Of those, as they were fitted together.
    plate_from : int
        How many were put away before the plate that is there now.
    surveys : int
        How often the plate was looked at.
    zoom_runs : int
        How often the zoom has run: each time the image comes to rest a little elsewhere.
    needs_initialisation : bool
        Positions are not to be believed before the platform was initialised again.
    seen : LastSeen
        By which a frozen camera is known.
    plate, probe : Resource
        The plate with table and view of it, and the position in front of the probe: where several
        arms work, each is used by one at a time.
    arms : dict of str to HandlingContext
        Where several work, each by its gripper's name.
    seeking : set of str
        Grippers that have begun with a fibre, whether they have chosen it yet or not.
    parks_limit : bool
        The force limit is armed only while the probe is out.
    obstacles_um : tuple of ndarray, shape (n, 2)
        Corners of what stands on the plate, in its frame.
    enough : callable
        Says whether no further fibre is to be begun, for a procedure that treats many.
    """

    candidates: list[Candidate] = field(default_factory=list)
    lines_um: list[Floats] = field(default_factory=list)
    skipped: list[Candidate] = field(default_factory=list)
    standard: Candidate | None = None
    dropped: list[HeldFibre] = field(default_factory=list)
    unsuitable: list[Candidate] = field(default_factory=list)
    skip_reasons: Counter[str] = field(default_factory=Counter)
    zoomed: float | None = None
    zoom_runs: int = 0
    surveyed: bool = False
    since_survey: int = 0
    survey_deg: float = 0.0
    finished: list[HeldFibre] = field(default_factory=list)
    refits: Refits = field(default_factory=Refits)
    plate_from: int = 0
    surveys: int = 0
    numbers: int = 0
    needs_initialisation: bool = False
    seen: LastSeen = field(default_factory=LastSeen)
    plate: Resource = field(default_factory=lambda: Resource("the plate", 0))
    probe: Resource = field(default_factory=lambda: Resource("the probe", 1))
    arms: "dict[str, HandlingContext]" = field(default_factory=dict)
    seeking: set[str] = field(default_factory=set)
    parks_limit: bool = False
    obstacles_um: tuple[Floats, ...] = ()
    enough: Callable[[], bool] = _never

    def done_with(self, fibre: HeldFibre) -> None:
        """Note that a fibre is done with, and its arm free for another."""
        self.finished.append(fibre)
        self.seeking.discard(fibre.arm)

    def new_plate(self) -> None:
        """Note that another plate is there: nothing that was known of the one before holds."""
        for known in (self.candidates, self.lines_um, self.skipped, self.dropped, self.unsuitable):
            known.clear()
        self.skip_reasons = Counter()
        self.standard, self.surveyed, self.since_survey = None, False, 0
        self.plate_from = len(self.finished)


@dataclass(frozen=True, slots=True)
class Measured:
    """One calibration: when it was made, on the platform's clock, and how well it fits.

    Attributes
    ----------
    residual : float
        RMS, in `unit`.
    """

    time_s: float
    residual: float
    unit: str


@dataclass(slots=True)
class Calibration:
    """What was measured before fibres are handled, by name, with when and how well.

    Attributes
    ----------
    frame : PlateFrame
        About which point the plate turns.
    probe_off_um : (float, float)
        How far the probe's tip is from where its stages say, in the frame of the gripper.
    seen_off_um : (float, float)
        The same as an image showed it last: a touch tells it better, drift is told from this.
    drift_looked_at : int
        How many fibres were done with when drift was looked at last.
    touching : bool
        The probe has gone to a jaw, and not come back yet.
    zoom_run : int
        Since which run of the zoom the maps of the working zoom are in register; see
        `SharedWorkspace.zoom_runs`.
    up_um : dict of str to float
        How much higher above the plate the tip of each tool is than its stages say.
    registry : CalibrationRegistry
        Where it is kept beyond this work.
    """

    made: dict[str, Measured] = field(default_factory=dict)
    frame: PlateFrame = field(default_factory=PlateFrame)
    probe_off_um: tuple[float, float] = (0.0, 0.0)
    seen_off_um: tuple[float, float] = (0.0, 0.0)
    drift_looked_at: int = 0
    touching: bool = False
    zoom_run: int = -1
    up_um: dict[str, float] = field(default_factory=dict)
    registry: CalibrationRegistry = field(default_factory=CalibrationRegistry)

    def fresh(self, name: str, now_s: float, age_s: float) -> bool:
        """Return whether a calibration is there and not too old."""
        found = self.made.get(name)
        return found is not None and now_s - found.time_s <= age_s


class Applications(Protocol):
    """A rig, as `cosmic.connect()` returns it."""

    @property
    def mico(self) -> Mico:
        """Micromanipulation."""
        ...

    @property
    def daqco(self) -> Daqco:
        """Data acquisition."""
        ...

    @property
    def vico(self) -> Vico:
        """Vision."""
        ...


@dataclass(slots=True, eq=False)
class HandlingContext:
    """What one arm works with, and what it shares with others; belongs to the run's thread.

    Attributes
    ----------
    shared : SharedWorkspace
        What grippers share.
    fibre : HeldFibre or None
        The one held.
    gap_um : float or None
        Opening of the jaws, as steps since they were closed say; None before.
    stray_um : float
        How much higher than at first grasps are made now.
    failures : list of (str, OperationFailed)
        Every failure of an operation by its name, those included that a further try mended.
    """

    mico: Mico
    daqco: Daqco
    vico: Vico
    settings: HandlingSettings
    clock: Clock
    forces: ForceWatch
    calibration: Calibration = field(default_factory=Calibration)
    shared: SharedWorkspace = field(default_factory=SharedWorkspace)
    ready: bool = False
    fibre: HeldFibre | None = None
    gap_um: float | None = None
    stray_um: float = 0.0
    failures: list[tuple[str, OperationFailed]] = field(default_factory=list)

    @classmethod
    def on(cls, rig: Applications, settings: HandlingSettings | None = None) -> "HandlingContext":
        """Return the work on a platform; close it at the end.

        Raises
        ------
        ConfigError
            The platform has no such tool, camera or force channel.
        NotAvailable
            An application is not hosted.
        """
        settings = settings or HandlingSettings()
        clock = vision_of(rig.vico).clock
        forces = ForceWatch(rig.daqco, settings.push.channel, clock)
        work = cls(rig.mico, rig.daqco, rig.vico, settings, clock, forces)
        for name in (settings.gripper, settings.probe, *filter(None, [settings.other])):
            work.tool(name)
        rig.vico.camera(settings.camera)
        work.shared.obstacles_um = plate_obstacles(rig.mico)
        if isinstance(positions := work.vision.transform, PlatformTransform):
            work.calibration.registry = positions.registry
        forces.open()
        return work

    def command_as(self, name: str, mico: Mico) -> None:
        """Have axes move by the name of what runs, and of who asked for it: the log says both."""
        self.mico = mico_of(mico.application, f"{name} ({mico.source})")

    def close(self) -> None:
        """Let go of the force channel."""
        self.forces.close()

    # Several arms

    def arm(self, name: str) -> "HandlingContext":
        """Return the work of one of two arms, each of which stays on its own side."""
        arms = self.shared.arms
        if name not in arms:
            self.tool(name)
            arms[name] = replace(
                self,
                settings=of_arm(self.settings, name),
                calibration=Calibration(registry=self.calibration.registry),
                fibre=None,
                failures=[],
            )
        return arms[name]

    @property
    def arms(self) -> "tuple[HandlingContext, ...]":
        """All that work: this one, where it is alone."""
        return tuple(self.shared.arms.values()) or (self,)

    @property
    def beside_another(self) -> bool:
        """True where another arm may be at work at the same time."""
        return len(self.shared.arms) > 1

    # What the platform has

    @property
    def vision(self) -> VicoApplication:
        """The application behind cameras and positions."""
        return vision_of(self.vico)

    def tool(self, name: str) -> ToolSettings:
        """Return a tool of the platform file."""
        tools = {each.name: each for each in self.vision.settings.tool}
        if name not in tools:
            known = ", ".join(tools) or "none"
            raise ConfigError(f"there is no tool {name!r}; the platform has: {known}")
        return tools[name]

    @property
    def gripper(self) -> ToolSettings:
        """The tool that takes fibres up."""
        return self.tool(self.settings.gripper)

    @property
    def probe(self) -> ToolSettings:
        """The tool that pushes."""
        return self.tool(self.settings.probe)

    @property
    def jaws(self) -> Jaws:
        """The gripper as the choice of a fibre must know it."""
        half_um = self.gripper.width_um + self.settings.grasp.gap_um / 2.0
        return Jaws(forward=1.0 if self.gripper.forward[0] > 0.0 else -1.0, half_um=half_um)

    @property
    def table(self) -> str:
        """Name of the axis that turns the plate; raises `NotAvailable` where none is named."""
        axis = self.vision.settings.table_axis
        if not axis:
            raise NotAvailable(NO_TABLE)
        return axis

    @property
    def table_deg(self) -> float:
        """Where the table stands."""
        angle = self.mico[self.table].angle_deg
        if angle is None:
            raise NotAvailable(f"{self.table}: its angle is unknown: initialise the platform")
        return angle

    @property
    def hold_tip_um(self) -> float:
        """Height of the jaws' lower edge when a fibre is held in front of the probe."""
        tip_um = self.probe.tip_um[2] + self.up_um(self.probe)
        return tip_um - self.settings.places.hold_above_tip_um

    def up_um(self, tool: ToolSettings) -> float:
        """Return how much higher above the plate a tip is than its stages say."""
        return self.calibration.up_um.get(tool.name, 0.0)

    # Moving; positions are those of a tool's tip

    def at(
        self, tool: ToolSettings, x_um: float, y_um: float, z_um: float | None = None
    ) -> dict[str, float]:
        """Return where the axes of a tool stand with its tip at a position."""
        targets = axis_targets(tool, x_um, y_um)
        if z_um is not None:
            targets[tool.z_axis] = z_um - tool.tip_um[2] - self.up_um(tool)
        return targets

    def bin_position(self, z_um: float | None = None) -> dict[str, float]:
        """Return where the gripper's axes stand above the bin, beside obstacles on the plate."""
        positions, jaws = self.settings.places, self.jaws
        x, y = positions.bin_x_um * jaws.forward, positions.bin_y_um
        if self.shared.obstacles_um:
            frame, angle = self.calibration.frame, self.table_deg
            obstacles = [frame.on_platform(each, angle) for each in self.shared.obstacles_um]
            free = (
                aside
                for aside in (y, y - BIN_ASIDE_UM, y + BIN_ASIDE_UM)
                if not jaws.cover(obstacles, (x, aside), self.settings.grasp)
            )
            y = next(free, y)
        return self.at(self.gripper, x, y, z_um)

    def go(self, targets: Mapping[str, float]) -> RetryingMove:
        """Begin to move; to be yielded."""
        return RetryingMove(
            lambda: self.mico.move(dict(targets), wait=False),
            to_a_position=True,
            back=return_movement(self.mico, targets),
        )

    def go_up(self, z_um: float) -> RetryingMove:
        """Begin to move the gripper to a height; to be yielded."""
        tool = self.gripper
        return self.go({tool.z_axis: z_um - tool.tip_um[2] - self.up_um(tool)})

    def rise(self, z_um: float) -> RetryingMove:
        """Begin to move the gripper up to a height, or leave it where it is higher; to be yielded.

        Where a run to an end stop has left it beyond its limit, it goes back to that.
        """
        tool = self.gripper
        stage_um = max(z_um, self.height_now()) - tool.tip_um[2] - self.up_um(tool)
        return self.go({tool.z_axis: min(stage_um, self.highest_um)})

    @property
    def highest_um(self) -> float:
        """How far up the stage of the gripper may go."""
        limits = self.mico[self.gripper.z_axis].limits
        return math.inf if limits is None else limits[1]

    def tip_now(self, tool: ToolSettings) -> tuple[float, float]:
        """Return where a tool's tip is, as its stages say."""
        x, y = self.mico[tool.x_axis].position_um, self.mico[tool.y_axis].position_um
        if x is None or y is None:
            raise NotAvailable(f"{tool.name}: its position is unknown: initialise it")
        return tool.tip_um[0] + x, tool.tip_um[1] + y

    def height_now(self) -> float:
        """Return the height of the gripper's tip above the plate."""
        z = self.mico[self.gripper.z_axis].position_um
        if z is None:
            raise NotAvailable(f"{self.gripper.name}: its height is unknown: initialise it")
        return self.gripper.tip_um[2] + z + self.up_um(self.gripper)

    @property
    def grasp_um(self) -> float:
        """Height of the jaws' lower edge when they close around a fibre."""
        return self.settings.places.grasp_um + self.stray_um

    def learn_height(self, *, held: bool) -> None:
        """Make grasps a little higher after one that held, and lower after one that missed.

        Where heights were measured they are never made so low that jaws could press on the plate:
        when one misses at the lowest, heights are measured anew before the next fibre.
        """
        positions = self.settings.places
        lowest = -positions.stray_um
        if HEIGHTS in self.calibration.made or self.settings.gripper in self.calibration.up_um:
            lowest = max(lowest, positions.lowest_um - positions.grasp_um)
            if not held and self.stray_um <= lowest:
                self.calibration.made.pop(HEIGHTS, None)
                self.calibration.registry.forget(HEIGHTS, self.settings.gripper)
                self.stray_um = 0.0
                return
        stray = self.stray_um + (positions.raise_um if held else -positions.lower_um)
        self.stray_um = min(max(stray, lowest), positions.stray_um)

    # Looking

    def image(self) -> LiveImage:
        """Return the next image to be exposed; to be yielded."""
        return LiveImage(self.vico.camera(self.settings.camera), self.clock, self.shared.seen)

    def check_camera(self) -> None:
        """Raise `NotAvailable` where the camera has been lost for so long that it is given up.

        Asked where no image is needed for long: how long it is lost counts from the first asking.
        """
        camera = self.vico.camera(self.settings.camera)
        problem = camera.problem
        if self.shared.seen.stays_lost(problem):
            raise NotAvailable(f"no image of {camera.name}: {problem}")

    def mapped(self, image: CameraImage, height_um: float = 0.0) -> PixelMap:
        """Return the map of an image for things at a height above the plate."""
        plate_um = self.vision.settings.plate_um
        tool = self.settings.gripper if self.beside_another else None
        return map_at(self.vision.transform, image, plate_um + height_um, tool)

    def mapped_near(self, image: CameraImage, height_um: float) -> PixelMap:
        """Return the map of whichever of the two heights measured is nearer."""
        held = height_um > 0.5 * self.hold_tip_um
        return self.mapped(image, self.hold_tip_um if held else 0.0)

    def held_fibre(self) -> HeldFibre:
        """Return the held fibre."""
        if self.fibre is None:
            raise NotAvailable("no fibre was chosen: choose one first")
        return self.fibre


def vision_of(vico: Vico) -> VicoApplication:
    """Return the application behind the cameras; raises `NotAvailable` at another station."""
    application = vico.application
    if not isinstance(application, VicoApplication):
        raise NotAvailable("the cameras belong to another station: handle fibres there")
    return application


class FibreOperation(UnitOperation[HandlingContext]):
    """An operation that leaves word in the work of what it failed with.

    Subclasses override `steps` instead of `run`.
    """

    @override
    def run(self, work: HandlingContext) -> Steps:
        try:
            yield from self.steps(work)
        except CosmicError as exc:
            work.failures.append((self.name, failure_of(exc)))
            raise

    def steps(self, work: HandlingContext) -> Steps:
        """Carry it out."""
        raise NotImplementedError
