"""Whether a scene and the positioners of a platform fit together."""

import logging
from collections.abc import Iterator
from pathlib import Path

from cosmic.app.configuration.platform_file import PlatformFile
from cosmic.frame.config import not_there
from cosmic.frame.errors import ConfigError, NotAvailable, PluginError
from cosmic.frame.plugins import Kind, make
from cosmic.mico.core.collision.checker import CollisionChecker, NoCollisionModel
from cosmic.mico.core.collision.collision_manager import CollisionManager
from cosmic.mico.core.collision.model import BodyPair, SceneModel, pair_of
from cosmic.mico.core.settings import ContactSettings

logger = logging.getLogger(__name__)


def load_checker(file: PlatformFile, path: Path) -> CollisionChecker:
    """Return the collision model that a platform file names, or the stand-in where none is named.

    Raises
    ------
    ConfigError
        The scene is wrong, or does not fit the platform; a line for every mistake.
    """
    if not file.platform.scene:
        return NoCollisionModel()
    # Imported here: what reads meshes takes its time to load.
    from cosmic.mico.core.collision.scene_loader import load_scene

    scene = load_scene(path.parent / file.platform.scene)
    mistakes = misfits(file, path, scene)
    if mistakes:
        raise ConfigError("\n".join(mistakes))
    checker = CollisionManager(
        scene,
        answer_s=file.mico.watch.collision_answer_s,
        axes=(each.name for each in file.mico.positioner),
    )
    for each in file.mico.contact:
        _respond(checker, each, path)
    return checker


def _respond(checker: CollisionManager, contact: ContactSettings, path: Path) -> None:
    """Set what the platform file says of a contact; one that cannot be loaded is refused."""
    try:
        callback = make(Kind.CONTACT, contact.response, None, contact.options)
        checker.set_callback(pair_of(*contact.bodies), callback)
    except PluginError as exc:
        logger.error("%s; contacts of %s are refused", exc, " and ".join(contact.bodies))
    except NotAvailable as exc:
        raise ConfigError(f"{path}: mico.contact: {exc}") from exc


def misfits(file: PlatformFile, path: Path, scene: SceneModel) -> list[str]:
    """Return where a scene and the positioners do not fit together, a line each."""
    positioners = {each.name: each for each in file.mico.positioner}
    lines = [
        f"{path}: platform.scene: {file.platform.scene} drives {axis}, which is not a positioner"
        for axis in scene.axes
        if axis not in positioners
    ]
    for index, each in enumerate(file.mico.positioner):
        where = f"{path}: mico.positioner[{index}]"
        if each.name not in scene.axes:
            lines.append(
                f"{where}.name: {each.name} moves nothing in {file.platform.scene}; add a drive"
            )
        elif each.limits is not None:
            low, high = scene.travel(each.name)
            if not low <= each.limits[0] <= each.limits[1] <= high:
                lines.append(
                    f"{where}.limits_{each.unit}: {each.limits[0]:g} to {each.limits[1]:g} reaches "
                    f"beyond the hard stops of {file.platform.scene}, {low:g} to {high:g}"
                )
    return [*lines, *_contact_mistakes(file, path, scene)]


def _contact_mistakes(file: PlatformFile, path: Path, scene: SceneModel) -> Iterator[str]:
    """Yield a line for each contact of bodies that are not watched, or that has two responses."""
    watched = {pair.bodies for pair in scene.pairs}
    seen: set[BodyPair] = set()
    for index, each in enumerate(file.mico.contact):
        where = f"{path}: mico.contact[{index}].bodies"
        pair = pair_of(*each.bodies)
        unknown = [body for body in each.bodies if body not in scene.bodies]
        if unknown:
            yield f"{where}: {not_there('body', unknown[0], scene.bodies)}"
        elif pair not in watched:
            yield f"{where}: {pair[0]} and {pair[1]} are not watched in {file.platform.scene}"
        elif pair in seen:
            yield f"{where}: {pair[0]} and {pair[1]} have a response already"
        seen.add(pair)
