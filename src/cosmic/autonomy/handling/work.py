"""What operations share: handles, calibration, sample, and the fibre in hand."""

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Protocol

from cosmic.autonomy.handling.bench import Bench, OfBench
from cosmic.autonomy.handling.force import ForceWatch
from cosmic.autonomy.handling.in_hand import Calibration, FibreInHand
from cosmic.autonomy.handling.live import LastSeen, LivePicture
from cosmic.autonomy.handling.patience import PatientMove, way_back
from cosmic.autonomy.handling.plate import Candidate, Jaws
from cosmic.autonomy.handling.settings import HandlingSettings
from cosmic.autonomy.handling.sides import of_hand
from cosmic.autonomy.handling.sight import map_at
from cosmic.autonomy.places import PlatformPlaces
from cosmic.autonomy.procedures.operation import OperationFailed
from cosmic.autonomy.tools import axis_targets
from cosmic.daqco.api.daqco import Daqco
from cosmic.frame.clock import Clock
from cosmic.frame.errors import ConfigError, NotAvailable
from cosmic.mico.api.mico import Mico
from cosmic.vico.api.application import VicoApplication
from cosmic.vico.api.vico import Vico
from cosmic.vico.core.picture import Picture
from cosmic.vico.core.pixel_map import Floats, PixelMap
from cosmic.vico.core.tool_settings import ToolSettings

__all__ = ["FibreInHand", "FibreWork", "Handles", "vision_of"]


class Handles(Protocol):
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
class FibreWork:
    """What one hand works with, and what it shares with others; belongs to the run's thread.

    Attributes
    ----------
    bench : Bench
        What hands share. All of it that an operation uses can be had from here as well.
    fibre : FibreInHand or None
        The one in hand.
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
    bench: Bench = field(default_factory=Bench)
    ready: bool = False
    fibre: FibreInHand | None = None
    gap_um: float | None = None
    stray_um: float = 0.0
    failures: list[tuple[str, OperationFailed]] = field(default_factory=list)

    candidates = OfBench[list[Candidate]]()
    lines_um = OfBench[list[Floats]]()
    given_up = OfBench[list[Candidate]]()
    spilled = OfBench[list[FibreInHand]]()
    skipped = OfBench[Counter[str]]()
    zoomed = OfBench[float | None]()
    surveyed = OfBench[bool]()
    since_survey = OfBench[int]()
    survey_deg = OfBench[float]()
    finished = OfBench[list[FibreInHand]]()
    numbers = OfBench[int]()
    distrusted = OfBench[bool]()
    seen = OfBench[LastSeen]()

    @classmethod
    def on(cls, rig: Handles, settings: HandlingSettings | None = None) -> "FibreWork":
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
        if isinstance(places := work.vision.places, PlatformPlaces):
            work.calibration.book = places.book
        forces.open()
        return work

    def close(self) -> None:
        """Let go of the force channel."""
        self.forces.close()

    # Several hands

    def hand(self, name: str) -> "FibreWork":
        """Return the work of one of two hands, each of which stays on its own side."""
        hands = self.bench.hands
        if name not in hands:
            self.tool(name)
            hands[name] = replace(
                self,
                settings=of_hand(self.settings, name),
                calibration=Calibration(book=self.calibration.book),
                fibre=None,
                failures=[],
            )
        return hands[name]

    @property
    def hands(self) -> "tuple[FibreWork, ...]":
        """All that work: this one, where it is alone."""
        return tuple(self.bench.hands.values()) or (self,)

    @property
    def beside_another(self) -> bool:
        """True where another hand may be at work at the same time."""
        return len(self.bench.hands) > 1

    # What the platform has

    @property
    def vision(self) -> VicoApplication:
        """The application behind cameras and places."""
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
        """Name of the axis that turns the plate."""
        return self.vision.settings.table_axis

    @property
    def table_deg(self) -> float:
        """Where the table stands."""
        angle = self.mico[self.table].angle_deg
        if angle is None:
            raise NotAvailable(f"{self.table}: its angle is not known; initialise the platform")
        return angle

    @property
    def hold_tip_um(self) -> float:
        """Height of the jaws' lower edge when a fibre is held in front of the probe."""
        tip_um = self.probe.tip_um[2] + self.up_um(self.probe)
        return tip_um - self.settings.places.hold_above_tip_um

    def up_um(self, tool: ToolSettings) -> float:
        """Return how much higher above the plate a tip is than its stages say."""
        return self.calibration.up_um.get(tool.name, 0.0)

    # Moving; places are those of a tool's tip

    def at(
        self, tool: ToolSettings, x_um: float, y_um: float, z_um: float | None = None
    ) -> dict[str, float]:
        """Return where the axes of a tool stand with its tip at a place."""
        targets = axis_targets(tool, x_um, y_um)
        if z_um is not None:
            targets[tool.z_axis] = z_um - tool.tip_um[2] - self.up_um(tool)
        return targets

    def go(self, targets: Mapping[str, float]) -> PatientMove:
        """Begin to move; to be yielded."""
        return PatientMove(
            lambda: self.mico.move(dict(targets), wait=False),
            to_a_place=True,
            back=way_back(self.mico, targets),
        )

    def go_up(self, z_um: float) -> PatientMove:
        """Begin to move the gripper to a height; to be yielded."""
        tool = self.gripper
        return self.go({tool.z_axis: z_um - tool.tip_um[2] - self.up_um(tool)})

    def tip_now(self, tool: ToolSettings) -> tuple[float, float]:
        """Return where a tool's tip is, as its stages say."""
        x, y = self.mico[tool.x_axis].position_um, self.mico[tool.y_axis].position_um
        if x is None or y is None:
            raise NotAvailable(f"{tool.name}: where it stands is not known; initialise it")
        return tool.tip_um[0] + x, tool.tip_um[1] + y

    def height_now(self) -> float:
        """Return the height of the gripper's tip above the plate."""
        z = self.mico[self.gripper.z_axis].position_um
        if z is None:
            raise NotAvailable(f"{self.gripper.name}: its height is not known; initialise it")
        return self.gripper.tip_um[2] + z + self.up_um(self.gripper)

    @property
    def grasp_um(self) -> float:
        """Height of the jaws' lower edge when they close around a fibre."""
        return self.settings.places.grasp_um + self.stray_um

    def learn_height(self, *, held: bool) -> None:
        """Make grasps a little higher after one that held, and lower after one that missed."""
        places = self.settings.places
        stray = self.stray_um + (places.raise_um if held else -places.lower_um)
        self.stray_um = min(max(stray, -places.stray_um), places.stray_um)

    # Looking

    def picture(self) -> LivePicture:
        """Return the next picture to be exposed; to be yielded."""
        return LivePicture(self.vico.camera(self.settings.camera), self.clock, self.seen)

    def mapped(self, picture: Picture, height_um: float = 0.0) -> PixelMap:
        """Return the map of a picture for things at a height above the plate."""
        plate_um = self.vision.settings.plate_um
        tool = self.settings.gripper if self.beside_another else None
        return map_at(self.vision.places, picture, plate_um + height_um, tool)

    def mapped_near(self, picture: Picture, height_um: float) -> PixelMap:
        """Return the map of whichever of the two heights measured is nearer."""
        held = height_um > 0.5 * self.hold_tip_um
        return self.mapped(picture, self.hold_tip_um if held else 0.0)

    def in_hand(self) -> FibreInHand:
        """Return the fibre in hand."""
        if self.fibre is None:
            raise NotAvailable("no fibre was chosen: choose one first")
        return self.fibre


def vision_of(vico: Vico) -> VicoApplication:
    """Return the application behind the cameras; raises `NotAvailable` at another station."""
    application = vico.application
    if not isinstance(application, VicoApplication):
        raise NotAvailable("cameras of another station: handle fibres where they are")
    return application
