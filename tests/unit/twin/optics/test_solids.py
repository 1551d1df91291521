"""The bodies of the URDF as cameras see them."""

from pathlib import Path

import numpy as np
import pytest

from cosmic.frame.config import shipped_config_dir
from cosmic.frame.errors import ConfigError
from cosmic.twin.optics.solids import read_solids
from cosmic.twin.optics.view import shrunk

URDF = shipped_config_dir() / "scenes" / "fiberstation.urdf"


def test_boxes_and_meshes_have_their_corners_in_um() -> None:
    solids = read_solids(URDF, ("frame",))
    assert "frame" not in solids
    (shaft,) = solids["probe_tip"]
    assert np.allclose(
        [shaft.min(axis=0), shaft.max(axis=0)], [[-25, 0, -25], [25, 3000, 25]], atol=1e-3
    )
    (jaw,) = solids["left_jaw_a"]
    assert np.allclose(
        [jaw.min(axis=0), jaw.max(axis=0)], [[-6000, 0, 0], [0, 100, 500]], atol=1e-3
    )


@pytest.mark.parametrize(
    "collision",
    [
        "<collision/>",
        '<collision><geometry><sphere radius="1"/></geometry></collision>',
        '<collision><geometry><box size="1 x 1"/></geometry></collision>',
        '<collision><geometry><mesh filename="nowhere.stl"/></geometry></collision>',
    ],
)
def test_a_broken_body_is_named_with_its_file(tmp_path: Path, collision: str) -> None:
    urdf = tmp_path / "broken.urdf"
    urdf.write_text(f'<robot><link name="jaw">{collision}</link></robot>', encoding="utf-8")
    with pytest.raises(ConfigError, match=r"broken\.urdf"):
        read_solids(urdf, ())


def test_an_outline_is_shrunk_evenly_however_short_its_sides() -> None:
    corners = np.array([[0.0, 0], [100, 0], [100, 49.9], [99.9, 50], [0, 50]])
    inner = shrunk(corners, 10.0)
    assert inner is not None
    assert np.allclose([inner.min(axis=0), inner.max(axis=0)], [[10, 10], [90, 40]])
    assert np.allclose(np.sort(shrunk(corners[::-1], 10.0), axis=0), np.sort(inner, axis=0))
    assert shrunk(corners, 25.1) is None
