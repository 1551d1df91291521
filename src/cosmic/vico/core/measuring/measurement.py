"""The fibres of one image with its pixel size."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from numbers import Real
from pathlib import Path

import numpy as np
import numpy.typing as npt

from cosmic.frame.errors import ConfigError, NotAvailable
from cosmic.vico.core.measuring.image_files import FileImage, read_images
from cosmic.vico.core.measuring.pixel_sizes import LARGEST_UM, NOT_KNOWN, SMALLEST_UM
from cosmic.vico.core.vision.fibre import Fibre
from cosmic.vico.core.vision.finding import find_fibres
from cosmic.vico.core.vision.focal_stack import (
    FocalStack,
    HeightMap,
    height_map,
    sharp_image,
)
from cosmic.vico.core.vision.network import LEAST_SEGMENTS, Network, find_network
from cosmic.vico.core.vision.spatial import SpatialFibre, View, heights_along, in_space
from cosmic.vico.hw.interface import Pixels

FEWEST_DENSE = 12
"""So many fibres of which none is certain may be a network as well."""

Value = str | int | float | bool | None

UNITS = ("px", "um")
LENGTHS = ("length", "length_std", "projected_length", "width", "width_std")
PLAIN = ("curl", "kinks", "orientation_deg", "contrast")
SPATIAL = (
    "spatial_length_um",
    "spatial_length_std_um",
    "tilt_deg",
    "tilt_std_deg",
    "lowest_um",
    "highest_um",
    "spatial_doubt",
)


def columns(*, spatial: bool) -> tuple[str, ...]:
    """Return the columns of a row, those of a focal stack among them; also without a fibre."""
    both = [f"{name}_{unit}" for name in (*LENGTHS, "length_low", "length_high") for unit in UNITS]
    first = ("image", "fibre", "certain", "probability", "pixel_size_um")
    return (*first, *both, *PLAIN, *(SPATIAL if spatial else ()), "doubts", "file")


@dataclass(frozen=True, slots=True, eq=False)
class Measurement:
    """What was measured on one image.

    Attributes
    ----------
    name : str
        Of the file, with the number of its page where it has several; empty for an array.
    fibres : tuple of Fibre
        The longest first, in pixels.
    shape : tuple of int
        Rows and columns.
    pixel_size_um : float or None
        Side of a pixel; None where it is not known, so that there are no micrometres.
    pixel_size_from : str
        Where it was found.
    network : Network or None
        Where so much stands out that no single fibre is certain.
    spatial : tuple of SpatialFibre or str
        Of a focal stack, for each fibre: how it lies in space, or why that is not known.
    file : str
        The file as it was asked for, with its folders; empty for an array.
    """

    name: str
    fibres: tuple[Fibre, ...]
    shape: tuple[int, int]
    pixel_size_um: float | None
    pixel_size_from: str
    network: Network | None = None
    spatial: tuple[SpatialFibre | str, ...] = ()
    file: str = ""

    @property
    def lengths_um(self) -> tuple[float, ...]:
        """Lengths of the certain fibres; none without a pixel size."""
        scale = self.pixel_size_um
        if scale is None:
            return ()
        return tuple(fibre.length_px * scale for fibre in self.fibres if fibre.certain)

    def network_row(self) -> dict[str, Value] | None:
        """Return a row for the network, with units in the names of its columns; None without."""
        net = self.network
        if net is None:
            return None
        lengths = net.segment_lengths_px
        found: dict[str, Value] = {
            "image": self.name,
            "certain": net.certain,
            "pixel_size_um": self.pixel_size_um,
            "junctions": len(net.junctions_px),
            "segments": len(net.segments),
            "bundles": sum(each.bundle for each in net.segments),
            "alignment": net.alignment,
            "direction_deg": net.direction_deg,
            "covered": net.covered,
        }
        values = {
            "length": net.length_px,
            "length_std": net.length_std_px,
            "segment_length_median": float(np.median(lengths)) if len(lengths) else 0.0,
            "width_median": float(np.median([each.width_px for each in net.segments])),
        }
        for name, value in values.items():
            found[f"{name}_px"] = value
            found[f"{name}_um"] = None if self.pixel_size_um is None else value * self.pixel_size_um
        found["doubts"] = "; ".join(net.doubts)
        found["file"] = self.file
        return found

    def rows(self) -> list[dict[str, Value]]:
        """Return a row for each fibre, with units in the names of its columns."""
        found = []
        for number, fibre in enumerate(self.fibres, start=1):
            row: dict[str, Value] = {
                "image": self.name,
                "fibre": number,
                "certain": fibre.certain,
                "probability": fibre.probability,
                "pixel_size_um": self.pixel_size_um,
            }
            for name in LENGTHS:
                pixels = float(getattr(fibre, f"{name}_px"))
                row[f"{name}_px"] = pixels
                row[f"{name}_um"] = (
                    None if self.pixel_size_um is None else (pixels * self.pixel_size_um)
                )
            for name, bound in zip(("low", "high"), fibre.length_interval_px, strict=True):
                row[f"length_{name}_px"] = bound
                row[f"length_{name}_um"] = (
                    None if self.pixel_size_um is None else bound * self.pixel_size_um
                )
            row |= {name: getattr(fibre, name) for name in PLAIN}
            if self.spatial:
                row |= _spatial_columns(self.spatial[number - 1])
            row["doubts"] = "; ".join(fibre.doubts)
            row["file"] = self.file
            found.append(row)
        return found


def _spatial_columns(found: SpatialFibre | str) -> dict[str, Value]:
    """Return what a focal stack says of a fibre, or empty columns with the reason."""
    known = found if isinstance(found, SpatialFibre) else None
    heights = None if known is None else known.line_um[:, 2]
    values: tuple[Value, ...] = (
        None if known is None else known.length_um,
        None if known is None else known.length_std_um,
        None if known is None else known.tilt_deg,
        None if known is None else known.tilt_std_deg,
        None if heights is None else float(heights.min()),
        None if heights is None else float(heights.max()),
        found if isinstance(found, str) else "",
    )
    return dict(zip(SPATIAL, values, strict=True))


def measure(
    image: npt.NDArray[np.generic] | Path | str, pixel_size_um: float | None = None
) -> Measurement:
    """Measure the fibres on one image; needs no platform.

    Parameters
    ----------
    image : ndarray, shape (height, width) or (height, width, 3), or a file
        As `find_fibres` takes it, or a TIFF, OME-TIFF, PNG or JPEG with a single page.
    pixel_size_um : float, optional
        Side of a pixel, from 0.0001 to 10,000; otherwise what the file says.

    Raises
    ------
    ConfigError
        The image or the pixel size is none, or the file has several pages.
    NotAvailable
        Fibres cannot be looked for on this image.
    RecordingError
        The file cannot be read.
    TypeError
        The pixel size is no number.
    """
    if isinstance(image, Path | str):
        pages = list(read_images(Path(image)))
        if len(pages) != 1:
            raise ConfigError(f"{image} has {len(pages)} pages; measure them one by one")
        return replace(measure_page(pages[0], pixel_size_um), file=str(image))
    return measure_page(FileImage("", image, None, NOT_KNOWN), pixel_size_um)


def measure_page(page: FileImage, pixel_size_um: float | None = None) -> Measurement:
    """Measure one page of a file that `read_images` read; raises as `measure`."""
    check_pixel_size(pixel_size_um)
    try:
        fibres = tuple(find_fibres(page.pixels))
    except MemoryError as exc:
        raise NotAvailable(
            f"there is not enough memory for an image of shape {page.pixels.shape}; cut it"
        ) from exc
    size, source = page.pixel_size_um, page.pixel_size_from
    if pixel_size_um is not None:
        size, source = pixel_size_um, "given"
    rows, columns = page.pixels.shape[:2]
    dense = not any(each.certain for each in fibres) and not 0 < len(fibres) < FEWEST_DENSE
    return Measurement(
        page.name, fibres, (rows, columns), size, source, _network(page) if dense else None
    )


def check_pixel_size(pixel_size_um: object) -> None:
    """Refuse what is given as a pixel size and is none; None is that none is given.

    Raises
    ------
    ConfigError
        It is beyond what any microscope has.
    TypeError
        It is no number.
    """
    if pixel_size_um is None:
        return
    if isinstance(pixel_size_um, bool) or not isinstance(pixel_size_um, Real):
        said = f"{pixel_size_um!r:.60} ({type(pixel_size_um).__name__})"
        raise TypeError(f"pixel_size_um must be a number, not {said}")
    if not SMALLEST_UM <= float(pixel_size_um) <= LARGEST_UM:
        raise ConfigError(
            f"a pixel size is from {SMALLEST_UM:g} to {LARGEST_UM:g} µm, not {pixel_size_um} µm"
        )


@dataclass(frozen=True, slots=True, eq=False)
class MeasuredStack:
    """What was measured on a focal stack.

    Attributes
    ----------
    measurement : Measurement
        Of `sharp`, with `spatial`.
    sharp : ndarray, shape (height, width)
        One image that is sharp everywhere.
    heights : HeightMap
    """

    measurement: Measurement
    sharp: Pixels
    heights: HeightMap


def measure_stack(
    pages: Sequence[FileImage] | Sequence[npt.NDArray[np.generic]],
    heights_um: Sequence[float] | None = None,
    pixel_size_um: float | None = None,
    *,
    step_um: float | None = None,
    lens_distance_um: float = np.inf,
) -> MeasuredStack:
    """Measure fibres in space, on images of them at several heights of the focus.

    Parameters
    ----------
    pages : sequence of FileImage or ndarray, shape (height, width)
    heights_um : sequence of float, optional
        Height of the focus on each; otherwise they are `step_um` apart, or as far as the file says.
    pixel_size_um : float, optional
        At the height of the fibres; otherwise what the file says.
    lens_distance_um : float
        From the focus to the lens' entrance pupil, in the middle of the image; without it the lens
        is taken to be telecentric.

    Raises
    ------
    ConfigError
        Heights or pixel size are not known or none, there are fewer than four images, or they
        differ in more than their height: in channel, moment or pixel size.
    NotAvailable
        Fibres cannot be looked for on them.
    """
    files = [each if isinstance(each, FileImage) else _from_array(each) for each in pages]
    check_pixel_size(pixel_size_um)
    if not lens_distance_um > 0:
        raise ConfigError(f"the lens is above 0 µm away from the focus, not {lens_distance_um} µm")
    if not files or (pixel_size_um is None and files[0].pixel_size_um is None):
        said = f" (it is {files[0].pixel_size_from})" if files else ""
        raise ConfigError(f"a fibre in space needs images and a pixel size; give one{said}")
    if pixel_size_um is None and len({each.pixel_size_um for each in files}) > 1:
        raise ConfigError("focal stack: the images have different pixel sizes; give one")
    if heights_um is None:
        heights_um = _heights_um(files, step_um)
    stack = FocalStack.of([each.pixels for each in files], heights_um)
    heights = height_map(stack)
    sharp = sharp_image(stack, heights)
    flat = measure_page(replace(files[0], pixels=sharp), pixel_size_um)
    view = View(flat.pixel_size_um or np.nan, distance_um=lens_distance_um)
    spatial = tuple(_in_space(stack, fibre, view) for fibre in flat.fibres)
    return MeasuredStack(replace(flat, spatial=spatial), sharp, heights)


def _heights_um(files: Sequence[FileImage], step_um: float | None) -> list[float]:
    """Return the heights of images that follow one another in height alone."""
    besides = files[0].besides_height
    if besides:
        raise ConfigError(
            f"focal stack: the file has {besides}, so its pages are not heights alone; save one "
            "of them as a stack of heights (in ImageJ: Image > Duplicate)"
        )
    step = step_um if step_um is not None else next((each.step_um for each in files), None)
    if step is None or not 0.0 < step < np.inf:
        raise ConfigError(
            f"the heights of the focus are not known (step {step} µm); the file says nothing "
            "of them: give the step"
        )
    return [step * number for number in range(len(files))]


def _from_array(pixels: npt.NDArray[np.generic]) -> FileImage:
    return FileImage("", pixels, None, NOT_KNOWN)


def _in_space(stack: FocalStack, fibre: Fibre, view: View) -> SpatialFibre | str:
    try:
        heights = heights_along(stack, fibre.centre_line_px, fibre.width_px)
    except NotAvailable as exc:
        return str(exc)
    found = in_space(fibre.centre_line_px, heights, view, stack.images[0].shape)
    ends_um = fibre.length_std_px * view.scale_um_px
    return replace(found, length_std_um=float(np.hypot(found.length_std_um, ends_um)))


def _network(page: FileImage) -> Network | None:
    """Return the network on a page without single fibres, where there is one."""
    try:
        found = find_network(page.pixels)
    except NotAvailable:
        return None
    return found if len(found.segments) >= LEAST_SEGMENTS else None
