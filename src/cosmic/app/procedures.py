"""Campaigns and calibrations on a platform, as a rig offers them; loads all procedures."""

import platform as computer
from collections.abc import Callable, Sequence
from pathlib import Path

from typing_extensions import override

from cosmic.app.platform import Platform, stopped_since
from cosmic.app.provenance import commit, provenance_of
from cosmic.autonomy.calibrating.registry import CalibrationRegistry
from cosmic.autonomy.campaign.campaign import Campaign
from cosmic.autonomy.campaign.opening import CampaignHost, open_campaign, read_recipe
from cosmic.autonomy.campaign.recipe import Recipe
from cosmic.autonomy.campaign.records import TWIN
from cosmic.autonomy.coordinate_transform import PlatformTransform
from cosmic.autonomy.handling.context import Applications, HandlingContext
from cosmic.autonomy.handling.plate_change import PlateHandler
from cosmic.autonomy.handling.settings import HandlingSettings
from cosmic.autonomy.procedures.operation import Awaited
from cosmic.autonomy.procedures.procedure import Procedure
from cosmic.autonomy.shipped.calibrate import build_calibrate, calibration_names
from cosmic.frame.arguments import check_named, checked
from cosmic.frame.clock import Clock
from cosmic.frame.errors import ConfigError, NotAvailable, OperationCancelled
from cosmic.frame.version import __version__
from cosmic.twin.scene import Scene
from cosmic.vico.api.application import VicoApplication


@checked
def campaign_on(
    rig: Applications,
    platform: Platform,
    recipe: Recipe | str | Path,
    folder: str | Path,
    plates: PlateHandler | None,
    busy: Callable[[], str],
) -> Campaign:
    """Return a campaign that is ready to start; see `Rig.campaign`."""
    for name, value in (("recipe", recipe), ("folder", folder)):
        if not isinstance(value, Recipe):
            check_named(name, value)
    if plates is None and platform.scene is not None:
        plates = TwinPlates(platform.scene, platform.clock)
    read = recipe if isinstance(recipe, Recipe) else read_recipe(Path(recipe))
    host = CampaignHost(
        rig=rig,
        policy=platform.policy,
        stopped=stopped_since(None if platform.mico is None else rig.mico),
        hardware=TWIN if platform.simulated else platform.file.platform.name,
        rate=platform.clock.rate,
        seed=platform.seed if platform.simulated else 0,
        world=platform.world if platform.simulated else "",
        sample=platform.sample if platform.simulated else "",
        versions={
            "CoSMic": __version__,
            "Python": computer.python_version(),
            "commit": commit() or "unknown",
        },
        provenance=provenance_of(platform, read),
        plates=plates,
        busy=busy,
    )
    return open_campaign(read, Path(folder), host)


def registry_of(rig: Applications) -> CalibrationRegistry:
    """Return the calibration registry; see `Rig.calibrations`."""
    application = rig.vico.application
    transform = application.transform if isinstance(application, VicoApplication) else None
    if not isinstance(transform, PlatformTransform):
        raise NotAvailable("calibrations need cameras and axes in one program")
    return transform.registry


@checked
def calibration_on(
    rig: Applications, settings: HandlingSettings | None, anew: Sequence[str], *, zooms: bool
) -> tuple[Procedure[HandlingContext], HandlingContext]:
    """Return a procedure that calibrates, and its context, to be closed; see `Rig.calibrate`."""
    settings, registry = settings or HandlingSettings(), registry_of(rig)
    known = {each.name for each in registry.entries} | calibration_names()
    if unknown := [each for each in anew if each not in known]:
        listed = ", ".join(sorted(known))
        raise ConfigError(f"there is no calibration {unknown[0]!r}; there are: {listed}")
    for entry in registry.entries:
        if entry.name in anew:
            registry.forget(*entry.key)
    procedure, work = build_calibrate(settings, zooms=zooms), HandlingContext.on(rig, settings)
    work.command_as(procedure.name, rig.mico)
    return procedure, work


class TwinPlates(PlateHandler):
    """Puts plates on the table of a scene, by its clock, as somebody would: it takes a while."""

    name = "simulated handler"

    def __init__(self, scene: Scene, clock: Clock) -> None:
        self._scene = scene
        self._clock = clock

    @override
    def change(self, plate: int) -> Awaited:
        self._scene.check_plate_change()
        return _Exchange(self._scene, self._clock)

    @override
    def put(self, plate: int) -> None:
        self._scene.change_plate()

    @override
    def restore(self, plate: int) -> None:
        while self._scene.plate < plate - 1:
            self._scene.change_plate()


class _Exchange:
    """One change of the plate under way, until the platform's clock says that it is over."""

    def __init__(self, scene: Scene, clock: Clock) -> None:
        self._scene = scene
        self._clock = clock
        self._until_s = clock.now_s() + scene.settings.plate.exchange_s
        self._cancelled = False

    @property
    def done(self) -> bool:
        """True when the time is over, or somebody ended it."""
        return self._cancelled or self._clock.now_s() >= self._until_s

    def wait(self, timeout_s: float | None = None) -> object:  # noqa: ARG002 - by the protocol
        """Put the plate there; raises where it was ended before."""
        if self._cancelled:
            raise OperationCancelled("the plate was not changed")
        return self._scene.change_plate()

    def cancel(self) -> None:
        """Leave the old plate there."""
        self._cancelled = True
