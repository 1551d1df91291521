"""Skeletons, against those that scikit-image 0.26 made of the same masks."""

import hashlib

import cv2
import numpy as np
import pytest

from cosmic.vico.core.vision.graph import skeletonize

RECORDED = {
    "lines 0": "11b5fdc53bfa0b72",
    "noise 0": "d6a3ae808885284d",
    "blocks 0": "1cae78caf2910fde",
    "lines 1": "ab5ed48259fa10d2",
    "noise 1": "6f23dcad24ed1b9c",
    "blocks 1": "7b0b6c465198e021",
    "lines 2": "b48f659d9bcb6f44",
    "noise 2": "8312d5b109e535b8",
    "blocks 2": "8c06e1389232f679",
    "ring": "26a7c6505f125980",
    "full": "d9b7a5280228793e",
    "empty": "df3f619804a92fdb",
    "pixel": "76be8b528d0075f7",
    "row": "9541292f6352482c",
}


def masks() -> dict[str, np.ndarray]:
    """Lines, blobs, rings and noise, some of them up to the edge of the image."""
    made: dict[str, np.ndarray] = {}
    for seed in range(3):
        chance = np.random.RandomState(seed)  # the same numbers with every release of numpy
        lines = np.zeros((240, 320), np.uint8)
        for _ in range(6):
            points = chance.randint(-20, 340, (4, 1, 2)).astype(np.int32)
            cv2.polylines(lines, [points], False, 1, int(chance.randint(1, 15)), cv2.LINE_8)
        made[f"lines {seed}"] = lines
        noise = (chance.randint(0, 100, (90, 120)) < 20 + 30 * seed).astype(np.uint8)
        made[f"noise {seed}"] = noise
        made[f"blocks {seed}"] = np.kron(noise[:30, :40], np.ones((5, 7), np.uint8))
    ring = np.zeros((80, 80), np.uint8)
    cv2.circle(ring, (40, 40), 25, 1, 9)
    made["ring"] = ring
    made["full"] = np.ones((31, 44), np.uint8)
    made["empty"] = np.zeros((5, 6), np.uint8)
    made["pixel"] = np.ones((1, 1), np.uint8)
    made["row"] = np.ones((2, 40), np.uint8)
    return made


def digest(skeleton: np.ndarray) -> str:
    """What a skeleton is compared by."""
    return hashlib.sha256(np.packbits(skeleton != 0).tobytes()).hexdigest()[:16]


@pytest.mark.parametrize("name", RECORDED)
def test_a_skeleton_is_the_one_recorded(name: str) -> None:
    assert digest(skeletonize(masks()[name])) == RECORDED[name]


@pytest.mark.parametrize("name", [name for name in RECORDED if name.startswith(("line", "ring"))])
def test_what_hangs_together_stays_together_and_lies_within_the_mask(name: str) -> None:
    mask = masks()[name]
    skeleton = skeletonize(mask)
    assert skeleton.dtype == np.uint8
    assert skeleton.shape == mask.shape
    assert not skeleton[mask == 0].any()
    assert cv2.connectedComponents(skeleton)[0] == cv2.connectedComponents(mask)[0]
    assert 0 < skeleton.sum() < 0.5 * mask.sum()


def test_a_line_is_thinned_to_its_middle() -> None:
    mask = np.zeros((21, 60), np.uint8)
    mask[6:15, 5:55] = 1
    skeleton = skeletonize(mask)
    assert set(np.nonzero(skeleton[:, 12:48])[0]) == {10}
    assert np.ptp(np.nonzero(skeleton)[1]) >= 40


def test_the_mask_is_left_as_it_is() -> None:
    mask = masks()["ring"]
    before = mask.copy()
    skeletonize(mask)
    assert np.array_equal(mask, before)
