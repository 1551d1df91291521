"""``cosmic measure``: the fibres on images from anywhere, without a platform."""

import argparse
import os
import re
import sys
from collections import Counter
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

from cosmic.frame.errors import ConfigError, CosmicError, RecordingError
from cosmic.frame.interruption import Interrupted, held_back
from cosmic.vico.api.measure import (
    NOT_KNOWN,
    SUFFIXES,
    FileImage,
    Measurement,
    check_pixel_size,
    encoded,
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
OF_AN_IMAGE = re.compile(
    r"\d{4,}-.*-(overlay\.png|rois\.zip|napari\.csv|sharp\.png|heights\.tif)", re.DOTALL
)
BARS = 10
LONGEST_NAME = 255
LONGEST_STEM_BYTES = 200
"""What is added to it has to fit into the name of a file as well."""
MOST_UM = 1e6


@dataclass(slots=True)
class Results:
    """What was measured so far, and what was not."""

    measured: list[Measurement] = field(default_factory=list)
    refused: list[str] = field(default_factory=list)
    pages_refused: list[str] = field(default_factory=list)
    sizes_not_used: dict[str, None] = field(default_factory=dict)

    def refuse(self, file: Path, problem: CosmicError, *, page: str = "") -> None:
        """Note and show that a file, or one of its pages, is not measured."""
        name = str(file) if len(file.name) <= LONGEST_NAME else str(file)[:80]
        said = str(problem).removeprefix(f"{name}: ")
        line = f"{name}: {page}{': ' if page else ''}{said}"
        (self.pages_refused if page else self.refused).append(line)
        _say(line)

    def refuse_page(self, problem: RecordingError) -> None:
        """Note and show that a page cannot be read; the problem says which."""
        self.pages_refused.append(str(problem))
        _say(str(problem))

    def note_size(self, file: Path, page: FileImage) -> None:
        """Show once for a file why the pixel size that it states is not used."""
        line = f"{file}: pixel size {page.pixel_size_from}"
        if page.pixel_size_from.startswith(f"{NOT_KNOWN}: ") and line not in self.sizes_not_used:
            self.sizes_not_used[line] = None
            _say(line)


def run(chosen: argparse.Namespace) -> int:
    """Measure files one after another; one that is refused does not keep the rest from it."""
    _check_options(chosen)
    folder: Path = chosen.output or Path("measured")
    _check_apart(folder, chosen.images)
    files = found_files(_without_results(chosen.images, folder))
    made = _prepare(folder, files, overwrite=chosen.overwrite)
    results = Results()
    try:
        ended = _measured_all(files, folder, chosen, results)
    finally:  # what was measured is kept whatever ends the run
        if results.measured:  # else they would be in the way of the next run
            with held_back():  # a second signal, as `timeout` sends, leaves no half
                _write_tables(folder, results, spatial=chosen.focal_stack)
        else:
            _remove_empty(made)
    text = summary(results.measured, len(results.refused), len(results.pages_refused))
    where = f"{folder}\n" if results.measured else ""
    sys.stdout.write(encoded(f"{text}{where}").decode())
    if ended is not None:
        return ended.exit_code
    return 1 if results.refused or results.pages_refused else 0


def _measured_all(
    files: Sequence[Path], folder: Path, chosen: argparse.Namespace, results: Results
) -> Interrupted | None:
    """Measure all files; return the signal that ended it, if any."""
    begun = 0
    try:
        for begun, file in enumerate(files, start=1):
            _progress(f"{begun} of {len(files)}: {file.name}")
            try:
                _measure_file(file, folder, _stem(begun, file), chosen, results)
            except CosmicError as exc:
                results.refuse(file, exc)
    except Interrupted as exc:
        _say(
            f"interrupted at file {begun} of {len(files)}; the tables hold what was measured "
            "until then"
        )
        return exc
    if sys.stderr.isatty():
        sys.stderr.write("\n")
    return None


def _write_tables(folder: Path, results: Results, *, spatial: bool) -> None:
    write_csv(folder / TABLE, results.measured, spatial=spatial)
    write_json(folder / WHOLE, results.measured)
    write_networks(folder / NETWORKS, results.measured)
    write_report(folder / REPORT, results)


def _check_options(chosen: argparse.Namespace) -> None:
    """Refuse values that nothing can be done with, before a file is opened."""
    if not chosen.every >= 1:
        raise ConfigError(f"--every is 1 or more, not {chosen.every}")
    check_pixel_size(chosen.pixel_size_um)
    step, distance = chosen.step_um, chosen.lens_distance_um
    if not chosen.focal_stack and (step is not None or distance != float("inf")):
        raise ConfigError(
            "--step-um and --lens-distance-um are for a focal stack; say --focal-stack, or leave "
            "them out"
        )
    if step is not None and not 0 < step <= MOST_UM:
        raise ConfigError(f"--step-um is above 0 and up to {MOST_UM:g} µm, not {step:g}")
    if not distance > 0:
        raise ConfigError(f"--lens-distance-um is above 0 µm, not {distance:g}")


def _say(line: str) -> None:
    sys.stderr.write(f"{chr(10) if sys.stderr.isatty() else ''}cosmic: {line}\n")


def _stem(number: int, file: Path) -> str:
    """Return what the names of a file's results begin with, short enough for more to follow."""
    stem = f"{number:04d}-{file.stem}"
    while len(os.fsencode(stem)) > LONGEST_STEM_BYTES:
        stem = stem[:-1]
    return stem


def _progress(text: str) -> None:
    """Show how far it is, where somebody looks."""
    if sys.stderr.isatty():
        sys.stderr.write(f"\r{text}\033[K")
        sys.stderr.flush()


def found_files(chosen: Sequence[Path]) -> list[Path]:
    """Return the files, those of folders by name; raises `RecordingError` where there is none.

    Folders in them are not looked into. Results of an earlier run are left out, and so are the
    files ``._*`` that macOS writes beside others.
    """
    files: list[Path] = []
    for each in chosen:
        files += _images_in(each) if _is_folder(each) else [each]
    if not files:
        raise RecordingError(f"no image ({', '.join(SUFFIXES)}) in the folder; name another")
    return files


def _without_results(chosen: Sequence[Path], folder: Path) -> list[Path]:
    """Leave out results of an earlier run that a pattern such as ``*.png`` named as well."""
    if not (folder / WHOLE).exists():
        return list(chosen)
    apart = _real(folder)
    kept = [
        each
        for each in chosen
        if not (OF_AN_IMAGE.fullmatch(each.name) and _real(each.parent) == apart)
    ]
    if len(kept) < len(chosen):
        _say(f"{folder}: results of an earlier run left out: {len(chosen) - len(kept)}")
    return kept


def _real(path: Path) -> Path:
    """Return what links lead to; links in a circle are refused where they are read."""
    return Path(os.path.realpath(path))


def _is_folder(path: Path) -> bool:
    try:
        return path.is_dir()
    except OSError:  # a name that no file can have is refused where it is read
        return False


def _images_in(folder: Path) -> list[Path]:
    try:
        there = sorted(folder.iterdir())
    except OSError as exc:
        raise RecordingError(f"{folder}: cannot be listed ({exc.strerror or exc})") from exc
    found = [
        each
        for each in there
        if each.suffix.lower() in SUFFIXES and not each.name.startswith("._") and not each.is_dir()
    ]
    if folder / WHOLE not in there:
        return found
    images = [each for each in found if not OF_AN_IMAGE.fullmatch(each.name)]
    if len(images) < len(found):
        _say(f"{folder}: results of an earlier run left out: {len(found) - len(images)}")
    return images


def summary(measured: Sequence[Measurement], refused: int, pages_refused: int = 0) -> str:
    """Return what was found, in lines."""
    fibres = [fibre for each in measured for fibre in each.fibres]
    certain = sum(fibre.certain for fibre in fibres)
    lines = [f"images measured: {len(measured)}, files refused: {refused}"]
    if pages_refused:
        lines.append(f"pages or parts of other files refused: {pages_refused}")
    lines.append(f"fibres: {len(fibres)}, certain: {certain}")
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


def write_report(path: Path, results: Results) -> None:
    """Write what was found as a page: counts, lengths, reasons to doubt, files refused.

    Raises
    ------
    RecordingError
        It cannot be written.
    """
    measured, refused = results.measured, results.refused
    text = summary(measured, len(refused), len(results.pages_refused))
    lines = ["# Fibres measured", "", *(f"- {each}" for each in text.split("\n") if each)]
    lines += _lengths([length for each in measured for length in each.lengths_um])
    doubts = Counter(doubt for each in measured for fibre in each.fibres for doubt in fibre.doubts)
    if doubts:
        lines += ["", "## Why fibres are not certain", "", "| fibres | reason |", "|---:|---|"]
        lines += [f"| {count} | {doubt} |" for doubt, count in doubts.most_common()]
    for title, listed in {
        "Files refused": refused,
        "Pages and parts refused": results.pages_refused,
        "Pixel sizes not used": list(results.sizes_not_used),
    }.items():
        if listed:
            lines += ["", f"## {title}", "", *(f"- {each}" for each in listed)]
    try:
        path.write_bytes(encoded("\n".join(lines) + "\n"))
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


def _measure_file(
    file: Path, folder: Path, stem: str, chosen: argparse.Namespace, results: Results
) -> None:
    if chosen.focal_stack:
        results.measured.append(_measured_stack(file, folder, stem, chosen))
        return
    pages = read_images(file, chosen.every, results.refuse_page)
    for page in pages:
        if page.number > 1:
            _progress(page.name)
        if chosen.pixel_size_um is None:
            results.note_size(file, page)
        try:
            one = replace(measure_page(page, chosen.pixel_size_um), file=str(file))
        except CosmicError as exc:
            results.refuse(file, exc, page=page.name.removeprefix(file.name).strip())
            continue
        name = stem if page.number == 1 else f"{stem}-page-{page.number}"
        write_overlay(folder / f"{name}-overlay.png", page.pixels, one)
        write_rois(folder / f"{name}-rois.zip", one)
        write_napari(folder / f"{name}-napari.csv", one)
        results.measured.append(one)


def _measured_stack(file: Path, folder: Path, stem: str, chosen: argparse.Namespace) -> Measurement:
    """Measure the pages of a file as images of one thing at several heights of the focus."""
    stack = measure_stack(
        list(read_images(file, chosen.every)),
        None,
        chosen.pixel_size_um,
        step_um=chosen.step_um,
        lens_distance_um=chosen.lens_distance_um,
    )
    one = replace(stack.measurement, name=file.name, file=str(file))
    write_overlay(folder / f"{stem}-overlay.png", stack.sharp, one)
    write_rois(folder / f"{stem}-rois.zip", one)
    write_napari(folder / f"{stem}-napari.csv", one)
    write_heights(folder, stem, stack.sharp, stack.heights)
    return one


def _check_apart(folder: Path, chosen: Sequence[Path]) -> None:
    """Refuse results among the images: the next run would measure overlays as images."""
    for each in chosen:
        if _is_folder(each) and _real(each) == _real(folder):
            raise RecordingError(f"{folder}: holds the images; choose another folder with --output")


def _remove_empty(folders: Sequence[Path]) -> None:
    """Remove folders that were made for results of which there are none, the innermost first."""
    with suppress(OSError):  # something else is in it now
        for each in folders:
            each.rmdir()


def _prepare(folder: Path, files: Sequence[Path], *, overwrite: bool) -> tuple[Path, ...]:
    """Make the folder, without results of an earlier run; these go only where that is said.

    Returns the folders that were not there, the innermost first.
    """
    try:
        missing = tuple(each for each in (folder, *folder.parents) if not each.exists())
        folder.mkdir(parents=True, exist_ok=True)
        names = (TABLE, WHOLE, NETWORKS, REPORT)
        there = sorted(
            each
            for each in folder.iterdir()
            if each.name in names or OF_AN_IMAGE.fullmatch(each.name)
        )
    except OSError as exc:
        raise RecordingError(f"{folder}: cannot be created ({exc.strerror or exc})") from exc
    if there and not overwrite:
        raise RecordingError(
            f"{there[0]}: exists; choose another folder with --output, or say --overwrite"
        )
    images = {_real(each) for each in files}
    try:
        for each in there:
            if _real(each) not in images:
                each.unlink()
    except OSError as exc:
        raise RecordingError(f"{folder}: cannot be cleared ({exc.strerror or exc})") from exc
    return missing
