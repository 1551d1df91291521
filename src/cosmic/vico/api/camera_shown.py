"""What a camera's view shows of its recordings and of machine vision."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from types import MappingProxyType
from typing import TYPE_CHECKING, Self

from cosmic.frame.clock import Clock
from cosmic.frame.errors import CosmicError
from cosmic.frame.plan_shape import unix_of_platform_s
from cosmic.frame.renamed import Renamed
from cosmic.vico.core.image import CameraImage
from cosmic.vico.core.recording.formats import FORMATS, ImageFormat, recording_suffix
from cosmic.vico.core.recording.video_writer import check_codec
from cosmic.vico.core.vision.chain import Analysis, LinkState, Unavailable
from cosmic.vico.core.vision.tool_tips import HeldSeen, TipSeen
from cosmic.vico.hw.interface import CameraSettings

if TYPE_CHECKING:
    from cosmic.vico.core.vision.fibre import Fibre


def utc_of(image: CameraImage, clock: Clock) -> datetime:
    """Return when an image was exposed: what is shown may be old, where the camera stopped."""
    exposed_s = image.frame.exposed_s
    if not math.isfinite(exposed_s):  # a camera that does not tell
        return datetime.now(UTC)
    return datetime.fromtimestamp(unix_of_platform_s(clock, exposed_s), UTC)


DESCRIPTIONS = {
    "focus": "how sharp the image is",
    "fibres": "find fibres and measure them",
    "fibre track": "follow one fibre from image to image",
    "place track": "follow one point from image to image",
    "tools": "measure the ends of grippers and probe",
    "tips": "find the tips of grippers and probe",
    "held fibre": "follow the fibre that a gripper holds, and its slope at the jaws",
}


@dataclass(frozen=True, slots=True)
class LinkShown:
    """One link of the chain of machine vision.

    Attributes
    ----------
    problem : str
        Why it says nothing; empty when all is well.
    failing : bool
        It says nothing because it fails, and not because there is nothing to be said.
    """

    name: str
    description: str
    on: bool
    problem: str
    failing: bool = False


@dataclass(frozen=True, slots=True)
class FormatShown:
    """A way to record images."""

    name: str
    suffix: str
    description: str
    problem: str


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """What the chain found on one image.

    Attributes
    ----------
    results : mapping of str to object
        What every algorithm found, by its name, those of other packages too; empty where the
        camera is at a station.
    """

    image: CameraImage
    fibres: tuple["Fibre", ...]
    tips: tuple[TipSeen, ...]
    held: tuple[HeldSeen, ...] = ()
    results: Mapping[str, object] = field(default_factory=dict)
    picture = Renamed("image")

    @classmethod
    def of(cls, newest: Analysis) -> Self:
        """Return what is shown of the newest analysis."""
        fibres, tips = newest.results.get("fibres"), newest.results.get("tips")
        tracks = newest.results.get("held fibre")
        held = _held(tracks) if isinstance(tracks, Mapping) else ()
        return cls(
            newest.image,
            _loose(fibres, held) if isinstance(fibres, tuple) else (),
            tuple(each for each in tips if isinstance(each, TipSeen))
            if isinstance(tips, tuple)
            else (),
            held,
            MappingProxyType(dict(newest.results)),
        )


def _held(tracks: Mapping[str, object]) -> tuple[HeldSeen, ...]:
    from cosmic.vico.core.vision.held_tracking import held_seen

    found = (held_seen(name, track) for name, track in tracks.items())
    return tuple(each for each in found if each is not None)


def _loose(fibres: tuple["Fibre", ...], held: Sequence[HeldSeen]) -> tuple["Fibre", ...]:
    """Return the fibres that are not shown as held ones."""
    if not held:
        return fibres
    from cosmic.vico.core.vision.tool_bodies import without_held

    return without_held(fibres, [each.line_px for each in held])


def links_shown(states: Sequence[LinkState], newest: Analysis | None) -> tuple[LinkShown, ...]:
    """Return the links of a chain, in its order, as the newest image left them."""
    return tuple(
        LinkShown(
            state.name,
            DESCRIPTIONS.get(state.name, state.name),
            state.on,
            state.reason or (_reason(newest, state.name) if state.on else ""),
            failing=bool(state.reason),
        )
        for state in states
    )


def _reason(newest: Analysis | None, name: str) -> str:
    if newest is None:
        return ""
    failure, found = newest.failures.get(name), newest.results.get(name)
    if failure is not None:
        return failure.text
    return found.reason if isinstance(found, Unavailable) else ""


def formats_shown(settings: CameraSettings | None) -> tuple[FormatShown, ...]:
    """Return the ways to record with `settings`; the first is the usual one."""
    return tuple(
        FormatShown(name, recording_suffix(name), found.text, _format_problem(name, settings))
        for name, found in FORMATS.items()
    )


def _format_problem(name: ImageFormat, settings: CameraSettings | None) -> str:
    try:
        check_codec(name, load=False)
    except CosmicError as exc:
        return str(exc)
    if settings is not None and not FORMATS[name].holds(settings.pixel_format):
        return f"it cannot keep {settings.pixel_format}"
    return ""
