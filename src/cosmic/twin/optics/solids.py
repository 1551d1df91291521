"""The convex bodies of the URDF, as outlines seen from above."""

import math
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Final

import numpy as np

from cosmic.frame.arrays import Floats
from cosmic.frame.errors import ConfigError
from cosmic.twin.kinematics import UM_PER_M, from_rpy

ROUND: Final = 24
"""Corners of what stands for a circle."""

_STL: Final = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def read_solids(path: Path, hidden: tuple[str, ...]) -> dict[str, tuple[Floats, ...]]:
    """Return the corners of each link's collision bodies, each of shape (n, 3), um, by link.

    Raises
    ------
    ConfigError
        The URDF or a mesh is missing or broken.
    """
    try:
        root = ET.parse(path).getroot()
        return {
            link.attrib["name"]: bodies
            for link in root.iter("link")
            if link.attrib["name"] not in hidden
            and (bodies := tuple(_corners(path.parent, each) for each in link.iter("collision")))
        }
    except OSError as exc:
        raise ConfigError(f"{path}: cannot be read: {exc}") from exc
    except (ET.ParseError, AttributeError, KeyError, ValueError) as exc:
        raise ConfigError(f"{path}: a body is not written as URDF has it: {exc}") from exc


def _corners(folder: Path, element: ET.Element) -> Floats:
    geometry = element.find("geometry")
    if geometry is None or not len(geometry):
        raise ValueError("a collision has no geometry")
    shape = geometry[0]
    points = _shape(folder, shape)
    origin = element.find("origin")
    if origin is not None:
        turn = from_rpy(*_numbers(origin.get("rpy", "0 0 0")))
        points = points @ turn.T + _numbers(origin.get("xyz", "0 0 0"))
    return np.asarray(points * UM_PER_M)


def _shape(folder: Path, shape: ET.Element) -> Floats:
    if shape.tag == "box":
        signs = np.array(np.meshgrid([-0.5, 0.5], [-0.5, 0.5], [-0.5, 0.5])).reshape(3, -1).T
        return np.asarray(signs * _numbers(shape.attrib["size"]))
    if shape.tag == "cylinder":
        radius, half = float(shape.attrib["radius"]), 0.5 * float(shape.attrib["length"])
        angles = np.arange(ROUND) * (2.0 * math.pi / ROUND)
        ring = np.stack([radius * np.cos(angles), radius * np.sin(angles)], axis=1)
        ends = [np.column_stack([ring, np.full(ROUND, z)]) for z in (-half, half)]
        return np.concatenate(ends)
    if shape.tag == "mesh":
        scale = _numbers(shape.get("scale", "1 1 1"))
        data = (folder / shape.attrib["filename"]).read_bytes()
        corners = np.frombuffer(data, dtype=_STL, offset=84)["corners"]
        return np.unique(corners.reshape(-1, 3).astype(np.float64), axis=0) * scale
    raise ValueError(f"the twin's cameras know no {shape.tag}")


def _numbers(text: str) -> Floats:
    return np.array([float(word) for word in text.split()])
