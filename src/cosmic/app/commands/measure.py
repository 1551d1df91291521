"""``cosmic measure``: the fibres on images from anywhere, without a platform."""

import argparse
import sys
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from cosmic.frame.errors import CosmicError, RecordingError
from cosmic.vico.api.measure import (
    SUFFIXES,
    Measurement,
    measure_page,
    measure_stack,
    read_images,
    write_csv,
    write_heights,
    write_json,
    write_napari,
    write_networks,
    write_overlay,
    write_rois,
)

TABLE, WHOLE, NETWORKS, REPORT = "fibres.csv", "fibres.json", "networks.csv", "report.md"
BARS = 10


def run(chosen: argparse.Namespace) -> int:
    """Measure files one after another; one that is refused does not keep the rest from it."""
    files = found_files(chosen.images)
    folder: Path = chosen.output or Path("measured")
    _prepare(folder, overwrite=chosen.overwrite)
    measured: list[Measurement] = []
    refused: list[str] = []
    for number, file in enumerate(files, start=1):
        _progress(f"{number} of {len(files)}: {file.name}")
        try:
            measured += _measured(file, folder, f"{number:04d}-{file.stem}", chosen)
        except CosmicError as exc:
            said = str(exc).removeprefix(f"{file}: ")
            refused.append(f"{file.name}: {said}")
            sys.stderr.write(f"\ncosmic: {file}: {said}\n")
    if sys.stderr.isatty():
        sys.stderr.write("\n")
    write_csv(folder / TABLE, measured)
    write_json(folder / WHOLE, measured)
    write_networks(folder / NETWORKS, measured)
    write_report(folder / REPORT, measured, refused)
    sys.stdout.write(summary(measured, len(refused)) + f"{folder}\n")
    return 1 if refused else 0


def _progress(text: str) -> None:
    """Show how far it is, where somebody looks."""
    if sys.stderr.isatty():
        sys.stderr.write(f"\r{text}\033[K")
        sys.stderr.flush()


def found_files(chosen: Sequence[Path]) -> list[Path]:
    """Return the files, those of folders by name; raises `RecordingError` where there is none."""
    files: list[Path] = []
    for each in chosen:
        if each.is_dir():
            files += sorted(one for one in each.iterdir() if one.suffix.lower() in SUFFIXES)
        else:
            files.append(each)
    if not files:
        raise RecordingError(f"no image ({', '.join(SUFFIXES)}) in the folder; name another")
    return files


def summary(measured: Sequence[Measurement], refused: int) -> str:
    """Return what was found, in lines."""
    fibres = [fibre for each in measured for fibre in each.fibres]
    certain = sum(fibre.certain for fibre in fibres)
    lines = [
        f"images measured: {len(measured)}, files refused: {refused}",
        f"fibres: {len(fibres)}, certain: {certain}",
    ]
    lengths = [length for each in measured for length in each.lengths_um]
    if lengths:
        mean = sum(lengths) / len(lengths)
        weighted = sum(length**2 for length in lengths) / sum(lengths)
        lines.append(f"length of certain fibres: mean {mean:.1f} µm, weighted {weighted:.1f} µm")
    networks = sum(each.network is not None for each in measured)
    if networks:
        lines.append(f"networks without a certain fibre: {networks}")
    without = sum(each.pixel_size_um is None for each in measured)
    if without:
        lines.append(f"images without a pixel size: {without}; give one with --pixel-size-um")
    return "".join(f"{line}\n" for line in lines)


def write_report(path: Path, measured: Sequence[Measurement], refused: Sequence[str]) -> None:
    """Write what was found as a page: counts, lengths, reasons to doubt, files refused.

    Raises
    ------
    RecordingError
        It cannot be written.
    """
    lines = [
        "# Fibres measured",
        "",
        *(f"- {each}" for each in summary(measured, len(refused)).split("\n") if each),
    ]
    lines += _lengths([length for each in measured for length in each.lengths_um])
    doubts = Counter(doubt for each in measured for fibre in each.fibres for doubt in fibre.doubts)
    if doubts:
        lines += ["", "## Why fibres are not certain", "", "| fibres | reason |", "|---:|---|"]
        lines += [f"| {count} | {doubt} |" for doubt, count in doubts.most_common()]
    if refused:
        lines += ["", "## Files refused", "", *(f"- {each}" for each in refused)]
    try:
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    except OSError as exc:
        raise RecordingError(f"{path}: cannot be written ({exc.strerror or exc})") from exc


def _lengths(lengths_um: Sequence[float]) -> list[str]:
    """Return a table of how many certain fibres have which length."""
    if not lengths_um:
        return []
    low, high = min(lengths_um), max(lengths_um)
    step = (high - low) / BARS or 1.0
    counts = Counter(min(BARS - 1, int((each - low) / step)) for each in lengths_um)
    rows = [
        f"| {low + step * bar:.0f} to {low + step * (bar + 1):.0f} | {counts[bar]} |"
        for bar in range(BARS)
        if counts[bar]
    ]
    return ["", "## Lengths of certain fibres", "", "| µm | fibres |", "|---|---:|", *rows]


def _measured(file: Path, folder: Path, stem: str, chosen: argparse.Namespace) -> list[Measurement]:
    if chosen.focal_stack:
        return [_measured_stack(file, folder, stem, chosen)]
    found = []
    for number, page in enumerate(read_images(file, chosen.every), start=1):
        if number > 1:
            _progress(page.name)
        one = measure_page(page, chosen.pixel_size_um)
        name = stem if number == 1 else f"{stem}-page-{number}"
        write_overlay(folder / f"{name}-overlay.png", page.pixels, one)
        write_rois(folder / f"{name}-rois.zip", one)
        write_napari(folder / f"{name}-napari.csv", one)
        found.append(one)
    return found


def _measured_stack(file: Path, folder: Path, stem: str, chosen: argparse.Namespace) -> Measurement:
    """Measure the pages of a file as images of one thing at several heights of the focus."""
    stack = measure_stack(
        list(read_images(file, chosen.every)),
        None,
        chosen.pixel_size_um,
        step_um=chosen.step_um,
        lens_distance_um=chosen.lens_distance_um,
    )
    one = replace(stack.measurement, name=file.name)
    write_overlay(folder / f"{stem}-overlay.png", stack.sharp, one)
    write_rois(folder / f"{stem}-rois.zip", one)
    write_napari(folder / f"{stem}-napari.csv", one)
    write_heights(folder, stem, stack.sharp, stack.heights)
    return one


def _prepare(folder: Path, *, overwrite: bool) -> None:
    there = [each for each in (folder / TABLE, folder / WHOLE) if each.exists()]
    if there and not overwrite:
        raise RecordingError(
            f"{there[0]}: exists; choose another folder with --output, or say --overwrite"
        )
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as exc:
        raise RecordingError(f"{folder}: cannot be created ({exc.strerror or exc})") from exc
