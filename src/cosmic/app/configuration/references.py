"""What the files of a platform name that is not there: axes, channels, cameras and tools."""

from collections.abc import Collection
from pathlib import Path

from cosmic.app.configuration.platform_file import PlatformFile
from cosmic.frame.config import not_there, user_file
from cosmic.frame.errors import ConfigError
from cosmic.mico.core.poses import pose_misfits, read_poses
from cosmic.mico.core.teleoperation.profile_book import ProfileBook
from cosmic.vico.core.settings import VicoSettings
from cosmic.vico.core.tool_settings import tool_mistakes


def misnamed(file: PlatformFile, path: Path, applications: Collection[str]) -> list[str]:
    """Return a line for each name in a platform file that one application has from another.

    Parameters
    ----------
    applications : collection of str
        Those that run together: what is at another station is not known here.
    """
    kinds = file.mico.kinds
    lines: list[str] = []
    if {"daqco", "vico"} <= set(applications):
        lines += _trigger_mistakes(file)
    if "mico" not in applications:
        return [f"{path}: {each}" for each in lines]
    if file.vico is not None and "vico" in applications:
        lines += tool_mistakes(file.vico.tool, kinds)
        lines += _table_mistakes(file.vico, kinds)
    wanted = file.mico.teleoperation.force_channel
    if file.daqco is not None and "daqco" in applications and wanted:
        channels = [each.name for each in file.daqco.channel]
        if wanted not in channels:
            text = not_there("channel", wanted, channels)
            lines.append(f"mico.teleoperation.force_channel: {text}")
    return [f"{path}: {each}" for each in lines]


def _trigger_mistakes(file: PlatformFile) -> list[str]:
    """Return what is wrong with the camera that the sample clock triggers."""
    trigger = file.daqco.camera_trigger if file.daqco is not None else None
    if trigger is None or file.vico is None:
        return []
    cameras = {each.name: each for each in file.vico.camera}
    camera = cameras.get(trigger.camera)
    if camera is None:
        return [f"daqco.camera_trigger.camera: {not_there('camera', trigger.camera, cameras)}"]
    if camera.trigger != "hardware":
        return [f'daqco.camera_trigger.camera: give {camera.name} trigger = "hardware"']
    return []


def _table_mistakes(vico: VicoSettings, kinds: dict[str, str]) -> list[str]:
    axis = vico.table_axis
    if not axis or kinds.get(axis) == "rotary":
        return []
    wrong = f"{axis} is {kinds[axis]}: it does not rotate" if axis in kinds else ""
    return [f"vico.table_axis: {wrong or not_there('positioner', axis, kinds)}"]


def kept_mistakes(file: PlatformFile, path: Path) -> list[str]:
    """Return what is wrong with the poses and profiles that are kept beside a platform file."""
    settings = file.mico
    poses = user_file(settings.poses, path.parent)
    profiles = user_file(settings.teleoperation.profiles, path.parent)
    lines: list[str] = []
    try:
        if poses is not None and poses.exists():
            lines += [
                f"{poses}: {each}" for each in pose_misfits(read_poses(poses), settings.kinds)
            ]
    except ConfigError as exc:
        lines += str(exc).splitlines()
    try:
        book = ProfileBook(settings.teleoperation, profiles)
        lines += [f"{profiles}: {each}" for each in book.misfits(settings.kinds)]
    except ConfigError as exc:
        lines += str(exc).splitlines()
    return lines


def recipe_mistakes(file: PlatformFile, path: Path) -> list[str]:
    """Return what is wrong with the recipes beside a platform file that can run them."""
    recipes = sorted((path.parent / "recipes").glob("*.toml"))
    vico, daqco = file.vico, file.daqco
    if not recipes or vico is None or daqco is None:
        return []
    # Imported here: it loads all procedures.
    from cosmic.autonomy.campaign.opening import read_recipe, recipe_misfits

    lines: list[str] = []
    for each in recipes:
        try:
            lines += recipe_misfits(
                read_recipe(each),
                tools=[tool.name for tool in vico.tool],
                cameras=[camera.name for camera in vico.camera],
                channels=[channel.name for channel in daqco.channel],
            )
        except ConfigError as exc:
            lines += str(exc).splitlines()
    return lines
