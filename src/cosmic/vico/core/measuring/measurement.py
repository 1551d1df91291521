"""The fibres of one image with its pixel size."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from cosmic.frame.errors import ConfigError, NotAvailable
from cosmic.vico.core.measuring.image_files import NOT_KNOWN, FileImage, read_images
from cosmic.vico.core.vision.fibre import Fibre
from cosmic.vico.core.vision.finding import find_fibres
from cosmic.vico.core.vision.network import Network, find_network

FEWEST_SEGMENTS = 20
"""Less is dirt, not a network."""
FEWEST_DENSE = 12
"""So many fibres of which none is certain may be a network as well."""

Value = str | int | float | bool | None

LENGTHS = ("length", "length_std", "projected_length", "width", "width_std")
PLAIN = ("curl", "kinks", "orientation_deg", "contrast")


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
    """

    name: str
    fibres: tuple[Fibre, ...]
    shape: tuple[int, int]
    pixel_size_um: float | None
    pixel_size_from: str
    network: Network | None = None

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
            row["doubts"] = "; ".join(fibre.doubts)
            found.append(row)
        return found


def measure(
    image: npt.NDArray[np.generic] | Path | str, pixel_size_um: float | None = None
) -> Measurement:
    """Measure the fibres on one image; needs no platform.

    Parameters
    ----------
    image : ndarray, shape (height, width) or (height, width, 3), or a file
        As `find_fibres` takes it, or a TIFF, OME-TIFF, PNG or JPEG with a single page.
    pixel_size_um : float, optional
        Side of a pixel; otherwise what the file says.

    Raises
    ------
    ConfigError
        The image or the pixel size is none.
    NotAvailable
        Fibres cannot be looked for on this image.
    RecordingError
        The file cannot be read, or has several pages.
    """
    if isinstance(image, Path | str):
        pages = list(read_images(Path(image)))
        if len(pages) != 1:
            raise ConfigError(f"{image} has {len(pages)} pages; measure them one by one")
        return measure_page(pages[0], pixel_size_um)
    return measure_page(FileImage("", image, None, NOT_KNOWN), pixel_size_um)


def measure_page(page: FileImage, pixel_size_um: float | None = None) -> Measurement:
    """Measure one page of a file that `read_images` read; raises as `measure`."""
    if pixel_size_um is not None and not 0.0 < pixel_size_um < np.inf:
        raise ConfigError(f"a pixel size is above 0 µm and finite, not {pixel_size_um} µm")
    fibres = tuple(find_fibres(page.pixels))
    size, source = page.pixel_size_um, page.pixel_size_from
    if pixel_size_um is not None:
        size, source = pixel_size_um, "given"
    rows, columns = page.pixels.shape[:2]
    dense = not any(each.certain for each in fibres) and not 0 < len(fibres) < FEWEST_DENSE
    return Measurement(
        page.name, fibres, (rows, columns), size, source, _network(page) if dense else None
    )


def _network(page: FileImage) -> Network | None:
    """Return the network on a page without single fibres, where there is one."""
    try:
        found = find_network(page.pixels)
    except NotAvailable:
        return None
    return found if len(found.segments) >= FEWEST_SEGMENTS else None
