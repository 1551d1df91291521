"""Images over EPICS: sizes, kind and values are those of the image."""

import asyncio
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

pytest.importorskip("caproto")

from cosmic.app.gateways.epics_image import LARGEST_IMAGE, ImageRecord
from cosmic.vico.hw.interface import PixelFormat

RANDOM = np.random.default_rng(5)


def shown(data: np.ndarray, kind: PixelFormat) -> dict[str, Any]:
    record = ImageRecord("T:", "eye", kind)
    image: Any = SimpleNamespace(data=data, frame_id=2**31 + 7)
    asyncio.run(record.show(image))
    return {name[2:]: each for name, each in record.channels.items()}


@pytest.mark.parametrize(
    ("shape", "dtype", "kind", "said"),
    [
        ((3, 5), np.uint8, PixelFormat.MONO8, ("UInt8", "Mono", [5, 3, 0])),
        ((3, 5), np.uint16, PixelFormat.MONO12, ("UInt16", "Mono", [5, 3, 0])),
        ((3, 5, 3), np.uint8, PixelFormat.RGB8, ("UInt8", "RGB1", [3, 5, 3])),
    ],
)
def test_what_is_shown_is_the_image(shape: Any, dtype: Any, kind: Any, said: Any) -> None:
    data = RANDOM.integers(0, np.iinfo(dtype).max, shape, dtype)
    found = shown(data, kind)
    sizes = [found[f"ArraySize{at}_RBV"].value for at in range(3)]
    assert (found["DataType_RBV"].value, found["ColorMode_RBV"].value, sizes) == said
    values = found["ArrayData"].value
    back = np.frombuffer(values, np.uint8) if isinstance(values, bytes) else np.asarray(values)
    assert np.array_equal(back.reshape(shape), data)
    assert found["ArrayCounter_RBV"].value == 1
    assert found["UniqueId_RBV"].value == 7, "what EPICS counts has 31 bits"


def test_an_image_that_does_not_fit_has_an_alarm_and_no_data() -> None:
    for data in (np.ones((3, 5), np.uint16), np.ones((1, LARGEST_IMAGE + 1), np.uint8)):
        found = shown(data, PixelFormat.MONO8)
        assert len(found["ArrayData"].value) <= 1
        assert found["UniqueId_RBV"].alarm.severity.name == "INVALID_ALARM"
