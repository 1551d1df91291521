"""The report of one recording: a page that holds everything it shows, for who was not there."""

import base64
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from cosmic.app.results.sessions import About
from cosmic.app.results.timeline import Film, Timeline, Track
from cosmic.autonomy.campaign.report import TEMPLATES as SHARED
from cosmic.autonomy.campaign.svg_plot import BLUE, ORANGE, Axis, Plot, around
from cosmic.daqco.gui.plot.units import display_unit
from cosmic.frame.errors import CosmicError, RecordingError
from cosmic.frame.kept_file import write_whole
from cosmic.frame.units import with_micro_signs
from cosmic.vico.core.recording.reading import open_image_recording
from cosmic.vico.hw.interface import PixelFormat

TEMPLATES: Final = Path(__file__).parent / "templates"
ENDING: Final = "_report.html"
POINTS: Final = 1500
"""Of a drawn line: so many pieces, each by its lowest and highest value."""
MOST_AXES: Final = 2
LEAST_PART: Final = 0.1
"""Of what the axis went that went farthest: others have no curve of their own."""
MOST_LINES: Final = 200
_OF_OPERATIONS: Final = re.compile(r" moves .*, by |, .* started together")
WIDTH, HEIGHT = 760.0, 300.0
IMAGE_PX: Final = 640
FELT_PART: Final = 0.1
"""Of the largest force: what is more was felt."""
ROOM_PART: Final = 0.2
"""How much of the time before and after is shown."""


def report_path(recording: Path) -> Path:
    """Return where the report of a recording stands: beside it."""
    return recording.with_name(recording.stem + ENDING)


def write_recording_report(shown: Timeline, about: About, path: Path) -> None:
    """Write force, positions, marks and log of a recording as one HTML file; takes a moment.

    Parameters
    ----------
    about : About
        What a person wrote of its session.

    Raises
    ------
    RecordingError
        The file cannot be written.
    """
    lines = _happened(shown)
    image, image_words = _image_at_peak(shown)
    page = _environment().get_template("recording_report.html")
    text = page.render(
        name=shown.path.stem,
        facts=_facts(shown, about),
        channels=[_extremes(each, shown.start_s) for each in shown.forces if each.values.size],
        over_time=[_over_time(each, shown.start_s) for each in shown.forces if each.values.size],
        over_position=_over_positions(shown),
        pushed_words=_pushed_words(shown),
        image=image,
        image_words=image_words,
        happened=lines[:MOST_LINES],
        left_out=max(0, len(lines) - MOST_LINES),
    )
    try:
        write_whole(path, text)
    except OSError as exc:
        raise RecordingError(f"{path} cannot be written: {exc.strerror or exc}") from exc


def _environment() -> Environment:
    return Environment(
        loader=FileSystemLoader([TEMPLATES, SHARED]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def _facts(shown: Timeline, about: About) -> list[tuple[str, str]]:
    begun = shown.start_utc.strftime("%Y-%m-%d %H:%M:%S UTC") if shown.start_utc else "unknown"
    facts = [("File", shown.path.name), ("Begun", begun)]
    facts.append(("Duration", f"{shown.end_s - shown.start_s:.1f} s"))
    if shown.rate_hz:
        facts.append(("Samples", f"{shown.rate_hz:g} a second of each channel"))
    written = (("Sample", about.sample), ("Operator", about.operator), ("Note", about.note))
    facts += [(name, text) for name, text in written if text]
    if not shown.complete:
        facts.append(("Complete", "no: it was still running, or ended by an error or a kill"))
    return facts


def _extremes(track: Track, start_s: float) -> tuple[str, ...]:
    known = np.isfinite(track.high) & np.isfinite(track.low)
    if not known.any():
        return (track.name, "–", "–", "–", "–")
    unit = display_unit(track.unit)
    peak = int(np.nanargmax(np.where(known, track.high, np.nan)))
    values = float(np.nanmin(track.low)), float(np.nanmean(track.values)), float(track.high[peak])
    texts = (f"{value:.2f} {unit}".replace("-", "−") for value in values)
    return (track.name, *texts, f"{track.time_s[peak] - start_s:.2f}")


def _thinned(xs: np.ndarray, track: Track) -> tuple[list[float], list[float]]:
    """Return a line of few points that still goes through every peak."""
    known = np.isfinite(xs) & np.isfinite(track.values)
    xs, low, high = xs[known], track.low[known], track.high[known]
    if not len(xs):
        return [], []
    piece = max(1, -(-len(xs) // POINTS))
    firsts = np.arange(0, len(xs), piece)
    lowest, highest = np.minimum.reduceat(low, firsts), np.maximum.reduceat(high, firsts)
    places = xs[firsts]
    return np.repeat(places, 2).tolist(), np.column_stack([lowest, highest]).ravel().tolist()


def _over_time(track: Track, start_s: float) -> Markup:
    xs, ys = _thinned(track.time_s - start_s, track)
    return _drawn(xs, ys, "time, s", track, BLUE)


def _over_positions(shown: Timeline) -> list[Markup]:
    """Return the first channel over the axes that went farthest while it was pushed."""
    track = next((each for each in shown.forces if each.values.size), None)
    if track is None:
        return []
    times, ys = track.between(*_pushed_s(track))
    step = max(1, -(-len(ys) // (2 * POINTS)))
    times, ys = times[::step], ys[::step]
    places = {
        axis: np.array([axis.near(float(each)) for each in times])
        for axis in shown.moved
        if axis.unit == "um"
    }
    went = {axis: _went(found) for axis, found in places.items()}
    least = LEAST_PART * max(went.values(), default=0.0)
    farthest = sorted((each for each in went if went[each] > least), key=lambda each: -went[each])
    drawn = []
    for axis in farthest[:MOST_AXES]:
        known = np.isfinite(places[axis])
        label = f"{axis.name}, {display_unit(axis.unit)}"
        xs = places[axis][known].tolist()
        drawn.append(_drawn(xs, ys[known].tolist(), label, track, ORANGE))
    return drawn


def _pushed_words(shown: Timeline) -> str:
    track = next((each for each in shown.forces if each.values.size), None)
    if track is None:
        return ""
    begin_s, end_s = _pushed_s(track)
    return f"from {begin_s - shown.start_s:.1f} to {end_s - shown.start_s:.1f} s"


def _pushed_s(track: Track) -> tuple[float, float]:
    """Return from when to when the force was away from where it was most of the time."""
    known = track.values[np.isfinite(track.values)]
    rest = float(np.median(known)) if known.size else 0.0
    away = np.nan_to_num(np.abs(track.values - rest))
    felt = np.flatnonzero(away >= FELT_PART * float(away.max()))
    first_s, last_s = float(track.time_s[felt[0]]), float(track.time_s[felt[-1]])
    room_s = ROOM_PART * (last_s - first_s)
    return max(first_s - room_s, float(track.time_s[0])), min(
        last_s + room_s, float(track.time_s[-1])
    )


def _went(places: np.ndarray) -> float:
    known = places[np.isfinite(places)]
    return float(np.ptp(known)) if known.size else 0.0


def _drawn(
    xs: Sequence[float], ys: Sequence[float], label: str, track: Track, colour: str
) -> Markup:
    if not xs:
        return Markup("")
    across = Axis(label, *_wide(min(xs), max(xs)))
    up = Axis(f"{track.name}, {display_unit(track.unit)}", *_wide(min(ys), max(ys)))
    plot = Plot(across, up, f"{track.name} over {label}", WIDTH, HEIGHT)
    plot.line(xs, ys, colour)
    return Markup(plot.svg())


def _wide(low: float, high: float) -> tuple[float, float]:
    """Return ends of an axis, also of a value that never changed."""
    if not high - low > 1e-9 * max(abs(low), abs(high), 1e-9):
        return low - 1.0, high + 1.0
    return around(low, high)


def _happened(shown: Timeline) -> list[tuple[str, str]]:
    lines = [(each.time_s, each.text or each.kind) for each in shown.marks]
    lines += [(each.time_s, each.text) for each in shown.log]
    lines = [each for each in lines if not _OF_OPERATIONS.search(each[1])]
    return [(f"{at_s - shown.start_s:.2f}", with_micro_signs(text)) for at_s, text in sorted(lines)]


def _image_at_peak(shown: Timeline) -> tuple[Markup, str]:
    """Return the recorded image of the highest force; none where there is none to be read."""
    film = next((each for each in shown.films if len(each.time_s)), None)
    track = next((each for each in shown.forces if np.isfinite(each.high).any()), None)
    if film is None or track is None:
        return Markup(""), ""
    at_s = float(track.time_s[int(np.nanargmax(track.high))])
    try:
        data = _png(film, at_s)
    except (CosmicError, OSError, ValueError, IndexError):
        return Markup(""), ""  # the rest of the report is worth as much without
    content = base64.b64encode(data).decode()
    words = f"{film.camera or 'camera'} at the highest force, after {at_s - shown.start_s:.2f} s."
    image = f'<img width="{IMAGE_PX}" alt="{{}}" src="data:image/png;base64,{content}">'
    return Markup(image).format(words), words


def _png(film: Film, at_s: float) -> bytes:
    # Imported here: it loads OpenCV.
    import cv2

    with open_image_recording(film.path) as images:
        recorded = images[film.index_at(at_s)]
    pixels = recorded.data
    if pixels.ndim == 3:
        pixels = pixels[..., ::-1]
    if pixels.dtype.itemsize > 1:  # of 12 bits in 16 nothing would be seen
        coded = recorded.row and PixelFormat(recorded.row.pixel_format)
        full = coded.full_scale if coded else max(int(pixels.max()), 1)
        pixels = np.minimum(255.0 / full * pixels, 255.0).astype(np.uint8)
    scale = min(1.0, IMAGE_PX / pixels.shape[1])
    small = cv2.resize(pixels, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    found, data = cv2.imencode(".png", small)
    if not found:
        raise ValueError("no image can be made of it")
    return bytes(data)
