"""What a report shows of one fibre."""

import math
from html import escape
from typing import Any, Final

import cv2
import numpy as np
import numpy.typing as npt

from cosmic.autonomy.campaign.records import FibreRecord, Picture, Shape
from cosmic.autonomy.campaign.report_figures import EI_LABEL, force_figure, stiffness_figure
from cosmic.autonomy.campaign.report_markup import ShowPng, ShowSvg, table
from cosmic.autonomy.campaign.report_words import (
    interval,
    number,
    outcome_words,
    stiffness,
    width_words,
    with_interval,
)

PICTURE_PX: Final = 360
ASPECT: Final = 4.0 / 3.0
ROOM: Final = 1.5
"""How much more of the picture is shown than what it is about."""


def card(record: FibreRecord, svg: ShowSvg, png: ShowPng) -> str:
    """Return the card of a fibre that was read whole."""
    kind = "short" if record.bending is None else "long"
    parts = [
        f'<h3 class="{kind}" id="fibre-{record.number}">Fibre {record.number}: '
        f"{escape(outcome_words(record))}</h3>"
    ]
    if record.text:
        parts.append(f"<p>{escape(record.text)}</p>")
    figures = [_shown(each, png) for each in record.pictures[:2]]
    figures += [svg(each, 430) for each in (force_figure(record), stiffness_figure(record)) if each]
    cells = "".join(f'<td valign="top">{each}</td>' for each in figures[:2])
    more = "".join(f'<td valign="top">{each}</td>' for each in figures[2:])
    if cells:
        parts.append(
            f'<table class="plain"><tr>{cells}</tr>{f"<tr>{more}</tr>" if more else ""}</table>'
        )
    parts += [_shape(record.shape), _numbers(record)]
    return "\n".join(parts)


def _shape(shape: Shape) -> str:
    """Return what the picture says, with 95 % intervals."""
    if not math.isfinite(shape.length_um):
        return ""
    length = with_interval(shape.length_um, shape.length_std_um)
    curl = with_interval(shape.curl, shape.curl_std, 3)
    told = f"Length {length} µm, width {width_words(shape)} µm, curl {curl} (95 %)."
    return f"<p>{escape(told)}</p>"


def _numbers(record: FibreRecord) -> str:
    result = record.bending
    if result is None:
        return ""
    rows = [
        (
            f"{fit.place_um:.1f}",
            f"{number(fit.k_un_um, 3)} ± {number(1.96 * fit.k_std_un_um, 3)}",
            number(fit.k_loading_un_um, 3),
            number(fit.k_unloading_un_um, 3),
            number(fit.hysteresis_percent, 1),
            number(fit.drift_un_s, 3),
            number(fit.peak_un, 1),
            f"{fit.chi2:.0f} / {fit.freedom}",
            ", ".join(sorted(fit.flags)) or ("" if place in result.used else "not used"),
        )
        for place, fit in enumerate(result.spans)
    ]
    head = (
        "place, µm",
        "k, µN/µm (95 %)",
        "out",
        "back",
        "hysteresis, %",
        "drift, µN/s",
        "peak, µN",
        "chi²/dof",
        "notes",
    )
    told = (
        f"EI {stiffness(result.ei_n_m2)} ({interval(result.ei_low_n_m2, result.ei_high_n_m2)}) "
        f"{EI_LABEL}; clamp {result.clamp_offset_um:.1f} ± {1.96 * result.clamp_offset_std_um:.1f} "
        "µm behind the tip of the jaws."
    )
    doubts = "".join(f"<li>{escape(each)}</li>" for each in result.reasons)
    return f"<p>{escape(told)}</p>{f'<ul>{doubts}</ul>' if doubts else ''}{table(head, rows)}"


def _shown(picture: Picture, png: ShowPng) -> str:
    pixels = _cut(picture)
    if pixels.dtype == np.uint16:
        pixels = (pixels >> 8).astype(np.uint8)
    height, width = pixels.shape[:2]
    if width > PICTURE_PX:
        size = PICTURE_PX, max(1, round(height * PICTURE_PX / width))
        pixels = cv2.resize(pixels, size, interpolation=cv2.INTER_AREA)
    _, data = cv2.imencode(".png", pixels)
    scale = f", {picture.scale_um_px * width:.0f} µm wide" if picture.scale_um_px > 0.0 else ""
    words = f"{picture.name}{scale}"
    shown_px = PICTURE_PX if picture.region_px is not None else pixels.shape[1]
    return f"{png(data.tobytes(), shown_px, words)}<br><small>{escape(words)}</small>"


def _cut(picture: Picture) -> npt.NDArray[Any]:
    """Return what a picture is about, with room around it, as wide as high times 4 / 3."""
    pixels: npt.NDArray[Any] = picture.pixels
    if picture.region_px is None:
        return pixels
    left, top, width, height = picture.region_px
    wide = max(width, height * ASPECT) * ROOM
    high = wide / ASPECT
    x, y = left + width / 2.0 - wide / 2.0, top + height / 2.0 - high / 2.0
    rows = slice(max(0, round(y)), max(1, round(y + high)))
    columns = slice(max(0, round(x)), max(1, round(x + wide)))
    part = pixels[rows, columns]
    return part if part.size else pixels
