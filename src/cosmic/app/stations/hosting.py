"""Makes the applications of one process out of the platform file."""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from PySide6.QtCore import QStandardPaths

from cosmic.app.applications import ApplicationBackend, ApplicationContext, Site
from cosmic.app.configuration.platform_file import KNOWN_APPLICATIONS
from cosmic.app.configuration.scene_fit import load_checker
from cosmic.app.simulation import SimulationFaults
from cosmic.daqco.api.application import DaqcoApplication
from cosmic.daqco.core.left_behind import Closing, OpenRecordings, Outcome
from cosmic.daqco.core.settings import DaqcoSettings, DriverSettings
from cosmic.daqco.hw.factory import UnavailableBoards, make_library
from cosmic.daqco.hw.factory import join as join_boards
from cosmic.daqco.hw.interface import BoardLibrary, Source
from cosmic.frame.application import CosmicApplicationBase, GuiFactory
from cosmic.frame.config import without_tokens
from cosmic.frame.errors import ConfigError, NotAvailable, PluginError
from cosmic.frame.plugins import Kind, NoOptions, make
from cosmic.frame.version import __version__
from cosmic.mico.api.application import MicoApplication
from cosmic.mico.api.mico import mico_of
from cosmic.mico.core.settings import ControllerSettings, MicoSettings
from cosmic.mico.hw.factory import join, make_controller
from cosmic.mico.hw.interface import Controller
from cosmic.mico.hw.joined import UnavailableController
from cosmic.twin.scene import Scene
from cosmic.vico.api.application import VicoApplication
from cosmic.vico.hw.factory import make_camera_library, make_lens, make_light
from cosmic.vico.hw.interface import CameraLibrary
from cosmic.vico.hw.peripherals import Lens, Light
from cosmic.vico.hw.sim_peripherals import SimPeripherals

logger = logging.getLogger(__name__)

_LEVELS: Final = {
    Outcome.CLOSED: logging.WARNING,
    Outcome.UNSURE: logging.WARNING,
    Outcome.IN_USE: logging.DEBUG,
    Outcome.WHOLE: logging.DEBUG,
}


def open_recordings() -> OpenRecordings:
    """Return the notes of this user's open recordings."""
    place = QStandardPaths.StandardLocation.GenericStateLocation
    return OpenRecordings(
        Path(QStandardPaths.writableLocation(place)) / "CoSMic" / "open-recordings"
    )


def close_left_open(notes: OpenRecordings, folders: tuple[Path, ...]) -> list[Closing]:
    """Close what processes that are gone left open, and say so in the log."""
    found = notes.close_left_open(folders)
    for each in found:
        logger.log(_LEVELS[each.outcome], "%s", each.text)
    return found


@dataclass(frozen=True)
class Hosted:
    """The applications of one process, and what injects faults into what it simulates.

    Attributes
    ----------
    others : mapping of str to CosmicApplicationBase
        Applications of other packages, by name.
    failed : mapping of str to str
        Why an application that is named is not there.
    """

    mico: MicoApplication | None = None
    daqco: DaqcoApplication | None = None
    vico: VicoApplication | None = None
    faults: SimulationFaults | None = None
    others: Mapping[str, CosmicApplicationBase] = field(default_factory=dict)
    failed: Mapping[str, str] = field(default_factory=dict)


def build_applications(
    site: Site, names: Sequence[str], guis: Mapping[str, GuiFactory | None]
) -> Hosted:
    """Make the applications of those names that the platform file describes.

    Raises
    ------
    ConfigError
        An application, or something that it needs, is wrong in the platform file.
    """
    faults = SimulationFaults()
    if site.scene is not None:
        faults.join("scene", site.scene.faults)
    described = {"daqco": site.file.daqco, "vico": site.file.vico}
    wanted = [each for each in KNOWN_APPLICATIONS if each in names]
    wanted = [each for each in wanted if described.get(each, site) is not None]
    wanted += [each for each in names if each not in KNOWN_APPLICATIONS]
    made: dict[str, CosmicApplicationBase] = {}
    failed: dict[str, str] = {}
    for name in wanted:
        context = ApplicationContext(
            name, site, faults, guis.get(name), window=any(guis.values()), hosted=dict(made)
        )
        options = site.file.application.get(name, {})
        try:
            made[name] = make(Kind.APPLICATION, name, context, options)
        except (PluginError, NotAvailable) as exc:  # the others do without it
            if name in KNOWN_APPLICATIONS:
                raise
            logger.error("%s", exc)
            failed[name] = str(exc)
    mico, daqco, vico = (made.pop(each, None) for each in KNOWN_APPLICATIONS)
    return Hosted(
        mico if isinstance(mico, MicoApplication) else None,
        daqco if isinstance(daqco, DaqcoApplication) else None,
        vico if isinstance(vico, VicoApplication) else None,
        None if site.scene is None else faults,
        made,
        failed,
    )


def _build_mico(_options: NoOptions, context: ApplicationContext) -> CosmicApplicationBase:
    site, faults = context.site, context.faults
    settings = site.file.mico
    controllers = [_make_controller(site, each) for each in settings.controllers]
    for each in reversed(controllers):  # the first has the last word
        faults.join_simulated("controller", each)
    application = MicoApplication(
        join(controllers),
        settings,
        clock=site.clock,
        policy=site.policy,
        checker=load_checker(site.file, site.path),
        platform=site.file.platform.name,
        folder=site.path.parent,
        gui_factory=context.gui_factory,
    )
    # Made now, so that a profile that is wrong is told at the start.
    application.teleoperation_of(mico_of(application, "teleoperation"))
    return application


def _make_controller(site: Site, settings: MicoSettings | ControllerSettings) -> Controller:
    try:
        return make_controller(
            settings.backend,
            library_path=settings.library,
            serials=settings.serials,
            scene=site.scene,
            clock=site.clock,
            options=settings.options,
            seed=site.seed,
        )
    except PluginError as exc:  # the rest of the platform does without it
        logger.error("%s", exc)
        return UnavailableController(settings.backend, str(exc))


def _make_boards(site: Site, settings: DaqcoSettings, driver: DriverSettings) -> BoardLibrary:
    try:
        return make_library(
            driver.backend,
            clock=site.clock,
            scene_sources=_sources(site.scene),
            clock_sources=settings.clock_sources,
            start_triggers=settings.start_triggers,
            trigger_lines=None if site.scene is None else site.scene.trigger_lines,
            options=driver.options,
            seed=site.seed,
        )
    except PluginError as exc:
        logger.error("%s", exc)
        return UnavailableBoards(driver.backend, str(exc))


def _build_daqco(_options: NoOptions, context: ApplicationContext) -> CosmicApplicationBase:
    site, faults = context.site, context.faults
    settings = site.file.daqco
    if settings is None:
        raise ConfigError(f"{site.path}: daqco: the section is missing")
    libraries = [_make_boards(site, settings, each) for each in settings.drivers]
    for each in reversed(libraries):  # what is injected reaches the boards of the first
        faults.join_simulated("board", each)
    notes = open_recordings()
    application = DaqcoApplication(
        join_boards(libraries),
        settings,
        clock=site.clock,
        policy=site.policy,
        software=f"CoSMic {__version__}",
        configuration=without_tokens(site.path.read_text(encoding="utf-8")),
        notes=notes,
        gui_factory=context.gui_factory,
    )
    close_left_open(notes, (application.directory,))
    return application


def _build_vico(_options: NoOptions, context: ApplicationContext) -> CosmicApplicationBase:
    site, faults = context.site, context.faults
    settings = site.file.vico
    if settings is None:
        raise ConfigError(f"{site.path}: vico: the section is missing")
    scene, simulation = site.scene, None
    if scene is not None and scene.lens is not None and scene.light is not None:
        simulation = SimPeripherals(scene.lens, scene.light, site.clock, site.seed)

    if scene is not None:
        faults.expect("camera")

    def make_library(backend: str) -> CameraLibrary:
        library = make_camera_library(
            backend,
            clock=site.clock,
            scene=scene,
            sources=settings.sources,
            producers=settings.producers,
            options=settings.options.get(backend),
            seed=site.seed,
        )
        faults.join_simulated("camera", library)
        return library

    def open_lens() -> Lens | None:
        lens = settings.lens
        return make_lens(
            lens.backend,
            clock=site.clock,
            port=lens.port,
            homed=lens.homed,
            limits_counts=lens.limits_counts,
            simulation=simulation,
            options=lens.options,
        )

    def open_light() -> Light | None:
        light = settings.light
        return make_light(
            light.backend,
            clock=site.clock,
            port=light.port,
            simulation=simulation,
            options=light.options,
        )

    return VicoApplication(
        make_library,
        open_lens,
        open_light,
        settings,
        clock=site.clock,
        policy=site.policy,
        gui_factory=context.gui_factory,
    )


def _sources(scene: Scene | None) -> dict[tuple[str, str], Source]:
    """Return what the twin connects to the inputs of the simulated boards."""
    if scene is None or scene.force_side is None:
        return {}
    sensors = scene.force_side.sensors
    sources: dict[tuple[str, str], Source] = {}
    for place, name in scene.settings.sensor_wiring.items():
        board, _, number = place.partition("/")
        sources[board, number] = sensors[name]
    return sources


DAQCO: Final = ApplicationBackend(_build_daqco)
MICO: Final = ApplicationBackend(_build_mico)
VICO: Final = ApplicationBackend(_build_vico)
