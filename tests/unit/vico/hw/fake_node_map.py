"""A GenTL camera with everything that the virtual producer's cameras lack."""

from typing import Any

import numpy as np


class NodeError(Exception):
    """What the package raises."""


class Number:
    """A feature with a range; `inc` is missing as on most floating numbers."""

    def __init__(
        self, camera: "FakeGenTL", value: float, low: float, high: float, inc: float | None = None
    ) -> None:
        self._camera = camera
        self._value = value
        self._inc = inc
        self.min = low
        self.max = high

    @property
    def inc(self) -> float:
        if self._inc is None:
            raise NodeError("node does not have an increment")
        return self._inc

    @property
    def value(self) -> float:
        return self._value

    @value.setter
    def value(self, value: float) -> None:
        nodes = self._camera.node_map
        if self is nodes.Width and value + nodes.OffsetX.value > nodes.SensorWidth.value:
            raise NodeError(f"width {value} reaches off the sensor")
        if self is nodes.OffsetX and value + nodes.Width.value > nodes.SensorWidth.value:
            raise NodeError(f"offset {value} reaches off the sensor")
        if not self.min <= value <= self.max or self in self._camera.broken:
            raise NodeError(f"value {value} must lie between {self.min} and {self.max}")
        self._value = value
        self._camera.order.append(self)


class Choice:
    def __init__(self, value: str, *symbolics: str) -> None:
        self.value = value
        self.symbolics = symbolics


class Command:
    def __init__(self) -> None:
        self.count = 0

    def execute(self) -> None:
        self.count += 1


class Buffer:
    def __init__(
        self, frame_id: int, data: np.ndarray, code: str, *, timestamp_ns: int | None = 5_000
    ) -> None:
        height, width = data.shape[:2]
        self.frame_id = frame_id
        self.queued = 0
        self._timestamp_ns = timestamp_ns
        component = type("Component", (), {})()
        component.data_format, component.data = code, data.reshape(-1)
        component.height, component.width = height, width
        self.payload = type("Payload", (), {"components": [component]})()

    @property
    def timestamp_ns(self) -> int:
        if self._timestamp_ns is None:
            raise NodeError("timestamps not supported")
        return self._timestamp_ns

    def queue(self) -> None:
        # The driver writes to it again at once.
        self.payload.components[0].data[:] = 0
        self.queued += 1


class FakeGenTL:
    """Stands for the package's ImageAcquirer, its remote device, its port and its node map."""

    def __init__(self) -> None:
        self.broken: set[Number] = set()
        self.order: list[Number] = []
        self.buffers: list[Buffer | Exception] = []
        self.there = True
        self.running = False
        self.remote_device: Any = self
        self.port: Any = self
        self.node_map: Any = type("NodeMap", (), {})()
        nodes = self.node_map
        nodes.ExposureTime = Number(self, 10_000.0, 20.0, 1e6)
        nodes.ExposureAuto = Choice("Continuous", "Off", "Continuous")
        nodes.Gain = Number(self, 0.0, 0.0, 24.0)
        nodes.AcquisitionFrameRate = Number(self, 20.0, 0.1, 60.0)
        nodes.Width = Number(self, 640, 16, 640, 16)
        nodes.Height = Number(self, 480, 2, 480, 2)
        nodes.OffsetX = Number(self, 0, 0, 624, 8)
        nodes.OffsetY = Number(self, 0, 0, 478, 2)
        nodes.BinningHorizontal = Number(self, 1, 1, 4, 1)
        nodes.BinningVertical = Number(self, 1, 1, 4, 1)
        nodes.SensorWidth = Number(self, 640, 640, 640)
        nodes.SensorHeight = Number(self, 480, 480, 480)
        nodes.PixelFormat = Choice("BayerRG8", "BayerRG8", "Mono8", "Mono12", "BGR8")
        nodes.TriggerMode = Choice("Off", "Off", "On")
        nodes.TriggerSource = Choice("Line1", "Software", "Line1")
        nodes.TriggerSoftware = Command()

    def start(self) -> None:
        self.running = True

    def stop(self) -> None:
        self.running = False

    def destroy(self) -> None:
        self.there = False

    def read(self, address: int, size: int) -> bytes:
        if not self.there:
            raise NodeError("no answer")
        return bytes(size)

    def try_fetch(self, *, timeout: float) -> Buffer | None:
        if not self.buffers:
            return None
        found = self.buffers.pop(0)
        if isinstance(found, Exception):
            raise found
        return found
