"""Beginning a campaign in a folder, or going on with the one that is there."""

import os
from collections.abc import Callable, Collection, Mapping
from contextlib import ExitStack
from dataclasses import dataclass, field
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any

from cosmic.autonomy.campaign.campaign import Campaign, Treatment
from cosmic.autonomy.campaign.plates import CampaignPlates
from cosmic.autonomy.campaign.provenance import (
    Provenance,
    read_provenance,
    sha256_of,
    write_provenance,
)
from cosmic.autonomy.campaign.recipe import Recipe, asks_the_same, load_recipe
from cosmic.autonomy.campaign.records import TWIN, CampaignError, CampaignInfo
from cosmic.autonomy.campaign.resume import ResumePlan, resume
from cosmic.autonomy.campaign.storage_format import DATABASE
from cosmic.autonomy.campaign.store import CampaignStore
from cosmic.autonomy.campaign.store_read import CampaignReader, refuse_raw_files_alone
from cosmic.autonomy.handling.context import Applications, HandlingContext, vision_of
from cosmic.autonomy.handling.plate_change import PlateByPerson, PlateHandler
from cosmic.autonomy.handling.settings import HandlingSettings
from cosmic.autonomy.procedures.procedure import Procedure
from cosmic.autonomy.shipped.registry import PARAMETERS, PROCEDURES, ShippedProcedure
from cosmic.frame.errors import ConfigError
from cosmic.frame.failure import FailurePolicy


@dataclass(frozen=True)
class CampaignHost:
    """The platform that a campaign runs on.

    Attributes
    ----------
    rig : Applications
        Its applications.
    policy : FailurePolicy
        Told of defects.
    stopped : callable
        Returns why motion is stopped, or None.
    hardware : str
        "digital twin", or the platform's name.
    seed : int
        Of everything random in the twin that runs: what is recorded, whatever the recipe says.
    world : str
        The twin's; empty on hardware.
    plates : PlateHandler or None
        What puts further plates on the table; None: a person does.
    sample : str
        What lies on the twin's plate.
    provenance : Provenance
        What the run is made with, for the record.
    busy : callable
        Returns what runs on the platform, in words; empty for nothing.
    """

    rig: Applications
    policy: FailurePolicy
    stopped: Callable[[], str | None]
    hardware: str
    rate: float = 1.0
    seed: int = 0
    versions: Mapping[str, str] = field(default_factory=dict)
    sample: str = ""
    provenance: Provenance = field(default_factory=Provenance)
    world: str = ""
    plates: PlateHandler | None = None
    busy: Callable[[], str] = str


def read_recipe(path: Path) -> Recipe:
    """Read a recipe with the parameters of a procedure that ships with CoSMic.

    Raises
    ------
    ConfigError
        One line per fault, each with file, key and reason.
    """
    return load_recipe(path, procedures=PARAMETERS)


def recipe_misfits(
    recipe: Recipe,
    *,
    tools: Collection[str],
    cameras: Collection[str],
    channels: Collection[str],
) -> list[str]:
    """Return a line for each name in a recipe that a platform has not: file, key, name."""
    settings = recipe.parameters
    if not isinstance(settings, HandlingSettings):
        return []
    wrong = settings.misfits(tools=tools, cameras=cameras, channels=channels)
    return [f"{recipe.path}: parameters.{each}" for each in wrong]


def open_campaign(recipe: Recipe, folder: Path, host: CampaignHost) -> Campaign:
    """Return a campaign that is ready to start; close its store at the end.

    In a folder that holds a campaign by the same recipe it goes on with that one: what is finished
    is not done again, and no position of before is trusted.

    Raises
    ------
    CampaignError
        The folder holds another campaign, is in use, or cannot be written.
    ConfigError
        The platform has not what the recipe names.
    NotAvailable
        An application is not hosted here.
    """
    parameters = recipe.parameters
    settings = parameters if isinstance(parameters, HandlingSettings) else HandlingSettings()
    shipped = PROCEDURES[recipe.file.procedure]
    if wrong := recipe_misfits(
        recipe,
        tools=[each.name for each in vision_of(host.rig.vico).settings.tool],
        cameras=host.rig.vico.cameras,
        channels=host.rig.daqco.channels,
    ):
        raise ConfigError("\n".join(wrong))
    with ExitStack() as undo:
        work = HandlingContext.on(host.rig, settings)
        undo.callback(work.close)
        work.command_as("campaign", host.rig.mico)
        store, known = _store(recipe, folder, host, work.clock.now_s())
        undo.callback(store.close)
        record = write_provenance(folder, store.run, host.provenance, recipe.text)
        store.keep_record(sha256_of(record))
        campaign = Campaign(
            work,
            Treatment(
                shipped.build(settings),
                measures=shipped.measures,
                standard=_standard(shipped, settings),
                plates=_plates(recipe, host, shipped, settings, known),
            ),
            recipe,
            store,
            policy=host.policy,
            stopped=host.stopped,
            known=known,
            busy=host.busy,
        )
        undo.pop_all()
    return campaign


def _standard(
    shipped: ShippedProcedure, settings: HandlingSettings
) -> Procedure[HandlingContext] | None:
    if shipped.standard is None or not settings.standard.ei_n_m2 > 0.0:
        return None
    return shipped.standard(settings)


def _plates(
    recipe: Recipe,
    host: CampaignHost,
    shipped: ShippedProcedure,
    settings: HandlingSettings,
    known: ResumePlan | None,
) -> CampaignPlates | None:
    most = recipe.file.stop.plates
    if most is None:
        return None
    handler = host.plates
    if handler is None or recipe.file.plates.by == "person":
        handler = PlateByPerson(handler)
    return CampaignPlates(
        most,
        handler,
        partial(shipped.change_plate, settings),
        number=1 if known is None else known.plate,
        pending=known is not None and known.plate_pending,
    )


def _store(
    recipe: Recipe, folder: Path, host: CampaignHost, now_s: float
) -> tuple[CampaignStore, ResumePlan | None]:
    if not (folder / DATABASE).exists():
        return CampaignStore.create(folder, _info(recipe, host), time_s=now_s), None
    # Before it is opened for writing: a run that was refused would count as one cut off.
    _check_same(CampaignReader(folder).info(), recipe, folder, host)
    _check_force_scale(folder, recipe, host)
    store = CampaignStore.open(folder, time_s=now_s, versions=host.versions)
    try:
        return store, resume(store)
    except BaseException:
        store.close()
        raise


def _check_same(info: CampaignInfo, recipe: Recipe, folder: Path, host: CampaignHost) -> None:
    if not asks_the_same(info.recipe_text, recipe, PARAMETERS):
        raise CampaignError(
            f"{folder} holds a campaign by another recipe than {recipe.path}: resume with "
            "that recipe, or name another folder"
        )
    if (info.hardware == TWIN) is not (host.hardware == TWIN):
        raise CampaignError(
            f"{folder} holds a campaign on {_platform(info.hardware)}, and this is "
            f"{_platform(host.hardware)}: simulated and real fibres do not go into one record. "
            "Name another folder"
        )
    if info.hardware == host.hardware == TWIN and info.seed != host.seed:
        raise CampaignError(
            f"{folder} holds a campaign on a twin with seed {info.seed}, and this one has seed "
            f"{host.seed}: its fibres differ. Resume with seed {info.seed}, or name another "
            "folder"
        )
    worlds = {info.world, host.world} - {""}  # of an older campaign it was not kept
    if info.hardware == host.hardware == TWIN and len(worlds) > 1:
        raise CampaignError(
            f"{folder} holds a campaign in the {info.world} world of the twin, and this one is "
            f"{host.world}. Resume with --world {info.world}, or name another folder"
        )


def _check_force_scale(folder: Path, recipe: Recipe, host: CampaignHost) -> None:
    """See that a channel makes the same force of a voltage as when the campaign was begun."""
    settings = recipe.parameters
    if not (isinstance(settings, HandlingSettings) and PROCEDURES[recipe.file.procedure].measures):
        return
    channel = settings.push.channel
    try:
        runs = read_provenance(folder)
    except CampaignError:  # `cosmic recompute` says so
        return
    now = _force_scale(host.provenance.settings, channel)
    for run in runs:
        before = _force_scale(run.get("settings", {}), channel)
        if before and now and before != now:
            raise CampaignError(
                f"{folder}: channel {channel} has the scale {now} now, and had {before} in run "
                f"{run.get('run')}: the sensor was calibrated or changed, and its forces do not go "
                "into one fit. Name another folder, or set the scale of before"
            )


def _force_scale(settings: Mapping[str, Any], channel: str) -> str:
    """Return unit and coefficients of a channel by the settings of a run; empty: not known."""
    daqco = (settings.get("platform") or {}).get("daqco") or {}
    named = {each.get("name"): each.get("scale") for each in daqco.get("channel", ())}
    scale = next((e for e in daqco.get("scale", ()) if e.get("name") == named.get(channel)), None)
    return "" if scale is None else f"{scale.get('unit')} {scale.get('coefficients')}"


def _platform(hardware: str) -> str:
    return f"the {TWIN}" if hardware == TWIN else f"the platform {hardware}"


def check_folder(folder: Path) -> None:
    """Refuse a folder that a campaign cannot be written to, before a platform is started for it.

    Raises
    ------
    CampaignError
        It is none, may not be written to, or has raw files alone; the text says which.
    """
    whole = folder.absolute()
    try:
        there = next(each for each in (whole, *whole.parents) if each.exists())
    except (OSError, ValueError) as exc:
        raise CampaignError(f"{folder} cannot be made: {exc}; name another folder") from exc
    if not there.is_dir():
        raise CampaignError(f"{folder}: {there} is not a folder; name another folder")
    if not os.access(there, os.W_OK | os.X_OK):
        raise CampaignError(f"{folder}: {there} may not be written to; name another folder")
    if not (whole / DATABASE).exists():
        refuse_raw_files_alone(folder)


def recorded(folder: Path) -> CampaignInfo | None:
    """Return what is kept of the campaign that a folder holds; None: it holds none.

    Raises
    ------
    CampaignError
        The campaign cannot be read.
    """
    return CampaignReader(folder).info() if (folder / DATABASE).exists() else None


def _sample_words(recipe: Recipe, host: CampaignHost) -> str:
    """Return what lay on the plate: what truly did, where the recipe names another sample."""
    said = recipe.file.sample
    if host.sample and host.sample != said.name:
        return host.sample
    return said.description or said.name


def _info(recipe: Recipe, host: CampaignHost) -> CampaignInfo:
    file = recipe.file
    return CampaignInfo(
        name=recipe.name,
        procedure=file.procedure,
        sample=_sample_words(recipe, host),
        recipe_text=recipe.text,
        started=datetime.now().astimezone().isoformat(timespec="seconds"),
        description=file.description,
        operator=file.operator,
        hardware=host.hardware,
        seed=host.seed,
        rate=host.rate,
        versions=host.versions,
        world=host.world,
    )
