"""The scene: one clock, one seed, and the truth about everything on the platform."""

import random
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Self

from cosmic.frame.clock import Clock
from cosmic.frame.config import shipped_config_dir
from cosmic.frame.errors import NotAvailable
from cosmic.twin.force_side import ForceSide
from cosmic.twin.kinematics import Point
from cosmic.twin.lasting_faults import LastingFaults
from cosmic.twin.lens import TwinLens
from cosmic.twin.light import TwinLight
from cosmic.twin.optics.optics import Optics
from cosmic.twin.plates import Plates
from cosmic.twin.settings import StageKind, TwinSettings
from cosmic.twin.stage import Stage
from cosmic.twin.trigger_line import TriggerLine
from cosmic.twin.truth import NO_TRUTH, Truth, record_sample
from cosmic.twin.twin_faults import TwinFaults

Wiring = tuple[tuple[str | None, ...], ...]

CHANNELS_PER_DEVICE: Final = 3
DEFAULT_MAKE: Final = "scu3d"
_KIND_OF_LETTER: Final = {"L": "linear", "R": "rotary", "N": "gripper"}


@dataclass(frozen=True, slots=True)
class AtPowerUp:
    """What a controller knows of one stage at the moment it is first looked at.

    Attributes
    ----------
    known : bool
        The position counted is referenced and agrees with the stage's true position. False: the
        count starts at zero wherever the stage stands.
    calibrated : bool
        The sensor was calibrated when the stage was mounted.
    scale : float
        Offset in the controller's memory: the position at its reference, in the stage's unit.
    safe_forward : bool
        The reference is looked for forward, not backward.
    """

    known: bool
    calibrated: bool
    scale: float
    safe_forward: bool = False


class Scene:
    """What is true at this moment; controllers and instruments are views of it.

    Parameters
    ----------
    settings : TwinSettings
        Constants.
    clock : Clock
        The platform's time.
    seed : int
        Of everything random in the scene and in its views.
    stages : mapping of str to Stage
        All stages by name.
    wiring : tuple of tuples of (str or None)
        Name of the stage at each device and channel; None where nothing is connected.
    makes : tuple of str
        Make of each device, such as "scu3d".
    at_power_up : mapping of str to AtPowerUp
        What the controllers know of each stage.
    force_side : ForceSide or None
        Fibres, tools and force sensors; None in a scene of bare stages.
    lens : TwinLens or None
        The motorised lens; None in a scene of bare stages.
    light : TwinLight or None
        The lamp; None in a scene of bare stages.
    optics : Optics or None
        What cameras see; None in a scene of bare stages.
    faults : TwinFaults or None
        Trouble with fibres, tips, lamp, lens and sensors, by name.
    truth : Truth
        Told what happens.
    plates : Plates or None
        What lies on later plates.
    world : str
        Name of the world it was drawn from; "" where nobody said.

    Attributes
    ----------
    trigger_lines : mapping of str to TriggerLine
        The wires that begin at counters of boards, such as "Dev1/ctr0".
    """

    def __init__(
        self,
        settings: TwinSettings,
        clock: Clock,
        *,
        seed: int,
        stages: Mapping[str, Stage],
        wiring: Wiring,
        makes: tuple[str, ...] = (),
        at_power_up: Mapping[str, AtPowerUp],
        force_side: ForceSide | None = None,
        lens: TwinLens | None = None,
        light: TwinLight | None = None,
        optics: Optics | None = None,
        faults: TwinFaults | None = None,
        truth: Truth = NO_TRUTH,
        plates: Plates | None = None,
        world: str = "",
    ) -> None:
        self.settings = settings
        self.clock = clock
        self.seed = seed
        self.world = world
        self.stages = dict(stages)
        self.wiring = wiring
        self.makes = makes or (DEFAULT_MAKE,) * len(wiring)
        self.at_power_up = dict(at_power_up)
        self.force_side = force_side
        self.lens = lens
        self.light = light
        self.optics = optics
        self.faults = faults or TwinFaults()
        self.trigger_lines = {place: TriggerLine() for place in settings.camera_wiring}
        self._truth = truth
        self._plates = plates
        self._plate = 0

    @classmethod
    def from_settings(
        cls,
        settings: TwinSettings,
        clock: Clock,
        seed: int = 0,
        *,
        cold: bool = False,
        folder: Path | None = None,
        sample: str = "",
        world: str = "",
        plates: Plates | None = None,
        truth: Truth = NO_TRUTH,
        apart: bool = False,
    ) -> Self:
        """Make the platform that `settings` describes.

        Parameters
        ----------
        cold : bool
            False: powered and referenced, every stage at its configured start, and the
            controllers' positions are true ones. True: just switched on, every stage somewhere,
            positions read zero; a reference run brings the true positions back.
        folder : Path or None
            Where twin.toml was read, for the files it names; None: what ships with CoSMic.
        sample : str
            Name of what lies on the plate, for the truth.
        world : str
            Name of the world it was drawn from.
        plates : Plates or None
            What lies on later plates; None: there is only this one.
        truth : Truth
            Told what happens; `close` ends it.
        apart : bool
            Images are drawn in a process of their own.

        Raises
        ------
        ConfigError
            A file that `settings` names is missing, broken or does not fit.
        """
        stages, at_power_up = _stages(settings, seed, cold=cold)
        wiring = tuple(tuple(name or None for name in d.channels) for d in settings.devices)
        files = folder or shipped_config_dir()
        lens, light = TwinLens(settings.lens, seed, cold=cold), TwinLight(settings.light)
        faults = TwinFaults()
        record_sample(truth, sample, seed, settings.fibres, world)
        force_side = ForceSide(settings, files, stages, seed, faults=faults, truth=truth)
        faults.begin = LastingFaults(clock, stages, force_side, lens, light)
        return cls(
            settings,
            clock,
            seed=seed,
            stages=stages,
            wiring=wiring,
            makes=tuple(device.make for device in settings.devices),
            at_power_up=at_power_up,
            force_side=force_side,
            lens=lens,
            light=light,
            optics=Optics(settings, files, stages, force_side, lens, light, seed, apart=apart),
            faults=faults,
            truth=truth,
            plates=plates,
            world=world,
        )

    @classmethod
    def from_layout(
        cls,
        layout: str,
        settings: TwinSettings,
        clock: Clock,
        seed: int = 0,
        *,
        cold: bool = True,
        channels: tuple[int, int] = (CHANNELS_PER_DEVICE, CHANNELS_PER_DEVICE),
    ) -> Self:
        """Make a scene of bare stages, named "device.channel", such as "0.2".

        Parameters
        ----------
        layout : str
            One group of three letters a device, such as "LLL,RNN": L linear with sensor, R rotary
            with sensor, N no sensor (a gripper).
        cold : bool
            True: just switched on for the first time, nothing in the controllers' memory but the
            sensors' calibration. False: referenced, every stage in the middle of its travel.
        channels : tuple of int
            How many letters a device has, at least and at most.

        Raises
        ------
        ValueError
            `layout` is not of that form, or a kind of stage is missing in `settings`.
        """
        stages: dict[str, Stage] = {}
        at_power_up: dict[str, AtPowerUp] = {}
        wiring: list[tuple[str | None, ...]] = []
        for device, letters in enumerate(parse_layout(layout, channels)):
            names = tuple(f"{device}.{channel}" for channel in range(len(letters)))
            wiring.append(names)
            for name, letter in zip(names, letters, strict=True):
                kind = _kind(settings, _KIND_OF_LETTER[letter])
                middle = (kind.low + kind.high) / 2.0
                region = kind.power_up_low, kind.power_up_high
                start = _somewhere(region, name, seed) if cold else middle
                stages[name] = Stage(name, kind, start=start, seed=seed)
                at_power_up[name] = AtPowerUp(
                    known=kind.sensor and not cold, calibrated=True, scale=0.0 if cold else kind.low
                )
        return cls(
            settings,
            clock,
            seed=seed,
            stages=stages,
            wiring=tuple(wiring),
            at_power_up=at_power_up,
        )

    def trigger_line_of(self, camera: str) -> TriggerLine | None:
        """Return the wire to the trigger input of a simulated camera; None where there is none."""
        for place, wired in self.settings.camera_wiring.items():
            if wired == camera:
                return self.trigger_lines[place]
        return None

    def devices_of(self, make: str) -> tuple[int, ...]:
        """Return the numbers of the devices of one make; all of a scene that has none of it."""
        fitting = tuple(number for number, each in enumerate(self.makes) if each == make)
        return fitting or tuple(range(len(self.wiring)))

    def close(self) -> None:
        """End the truth, and let go of what images are drawn with; harmless the second time."""
        # Where nobody asked for forces, to go on to the end takes some 50 ms: for a listener only.
        if self.force_side is not None and self._truth is not NO_TRUTH:
            self.force_side.timeline.finish(self.clock.now_s())
        self._truth.record(self.clock.now_s(), "end")
        self._truth.close()
        if self.optics is not None:
            self.optics.close()

    @property
    def plate(self) -> int:
        """How many plates were put there after the first."""
        return self._plate

    def change_plate(self) -> int:
        """Put another plate with new fibres there, at once, and return its number, from 1 on.

        Who calls it lets `settings.plate.exchange_s` of the platform's time pass first, as long
        as somebody takes to do it.

        Raises
        ------
        NotAvailable
            There are no other plates, something is in the jaws, or they stand too low.
        """
        self.check_plate_change()
        number = self._plate + 1
        if self._plates is not None and self.force_side is not None:
            fibres = self._plates.fibres(number)
            self.force_side.change_plate(self.clock.now_s(), number, fibres)
        self._plate = number
        return number

    def check_plate_change(self) -> None:
        """Check that the plate can be changed now.

        Raises
        ------
        NotAvailable
            As for `change_plate`.
        """
        if self._plates is None or self.force_side is None:
            raise NotAvailable("this scene has no other plate")
        self.force_side.check_plate_change(self.clock.now_s())

    def keep_up(self) -> None:
        """Do some of the physics that nobody has asked for yet; see `Timeline.keep_up`."""
        if self.force_side is not None:
            self.force_side.timeline.keep_up(self.clock.now_s())

    def truth(self) -> dict[str, float]:
        """Return where every stage truly is now, in its unit: for views and logs, not control."""
        now_s = self.clock.now_s()
        return {name: stage.position(now_s) for name, stage in self.stages.items()}

    def tips(self, now_s: float) -> dict[str, Point]:
        """Return where the tips of the tools truly are, um, world; see `Workspace.tips`.

        Empty in a scene of bare stages.
        """
        return {} if self.force_side is None else self.force_side.tips(now_s)


def parse_layout(
    layout: str, channels: tuple[int, int] = (CHANNELS_PER_DEVICE, CHANNELS_PER_DEVICE)
) -> tuple[str, ...]:
    """Return the letters of each device in `layout`; a comma at the end is no device.

    Raises
    ------
    ValueError
        The text is not groups of letters L, R, N, separated by commas.
    """
    low, high = channels
    most = "three" if low == high == CHANNELS_PER_DEVICE else f"{low} to {high}"
    groups = [group.strip() for group in layout.strip().removesuffix(",").split(",")]
    for number, group in enumerate(groups, start=1):
        if not re.fullmatch(f"[LRN]{{{low},{high}}}", group):
            raise ValueError(
                f"layout {layout!r}: device {number} is {group!r}; write {most} letters a device, "
                'L, R or N, and a comma between devices, such as "LLL,RNN"'
            )
    return tuple(groups)


def _kind(settings: TwinSettings, name: str) -> StageKind:
    if name not in settings.kinds:
        raise ValueError(f"the twin's settings have no kind of stage {name!r}")
    return settings.kinds[name]


def _stages(
    settings: TwinSettings, seed: int, *, cold: bool
) -> tuple[dict[str, Stage], dict[str, AtPowerUp]]:
    """Return the stages by name, and what the controllers know of each at power-up."""
    stages: dict[str, Stage] = {}
    at_power_up: dict[str, AtPowerUp] = {}
    for name, stage in settings.stages.items():
        kind = settings.kinds[stage.kind]
        start = _somewhere(stage.at_power_up(kind), name, seed) if cold else stage.start
        stages[name] = Stage(name, kind, start=start, seed=seed)
        known = kind.sensor and not cold
        forward = stage.safe_direction == "forward"
        at_power_up[name] = AtPowerUp(
            known=known,
            calibrated=True,
            scale=kind.high if forward else kind.low,
            safe_forward=forward,
        )
    return stages, at_power_up


def _somewhere(region: tuple[float, float], name: str, seed: int) -> float:
    """Return a position where nobody left the stage on purpose: never the middle."""
    low, high = region
    chance = random.Random(f"power-up {name} {seed}")
    part = chance.uniform(0.0, 0.4) if chance.random() < 0.5 else chance.uniform(0.6, 1.0)
    return low + part * (high - low)
