"""A V4L2 device as cv2.VideoCapture shows it: no exceptions, True for whatever is set."""

import threading
from collections.abc import Sequence
from typing import Any

import cv2
import numpy as np


class FakeDevice:
    """What stays when a capture is closed.

    Attributes
    ----------
    ready : int
        Images that wait in the driver.
    stubborn : set of int
        Properties that keep their value whatever is set.
    most : dict of int to float
        What properties are clipped to.
    """

    def __init__(self, *, ready: int = 4, exposure: float = 100.0) -> None:
        self.changed = threading.Condition()
        self.there = True
        self.ready = ready
        self.taken = 0
        self.stubborn: set[int] = set()
        self.most: dict[int, float] = {}
        self.values = {
            int(cv2.CAP_PROP_FPS): 30.0,
            int(cv2.CAP_PROP_EXPOSURE): exposure,
            int(cv2.CAP_PROP_AUTO_EXPOSURE): 3.0,
            int(cv2.CAP_PROP_FRAME_WIDTH): 64.0,
            int(cv2.CAP_PROP_FRAME_HEIGHT): 48.0,
        }

    def make(self, number: int) -> "FakeCapture":
        assert number == 2
        return FakeCapture(self)

    def take(self, count: int = 1) -> None:
        with self.changed:
            self.ready += count
            self.changed.notify_all()

    def unplug(self) -> None:
        with self.changed:
            self.there = False
            self.changed.notify_all()


class FakeCapture:
    def __init__(self, device: FakeDevice) -> None:
        self.device = device
        self.open = device.there

    @staticmethod
    def waitAny(
        streams: Sequence["FakeCapture"],
        timeoutNs: int = 0,  # noqa: N803 - OpenCV names it
    ) -> tuple[bool, list[int]]:
        device = streams[0].device
        with device.changed:
            device.changed.wait_for(lambda: device.ready or not device.there, timeoutNs * 1e-9)
            if not device.there:
                raise cv2.error("VIDEOIO/V4L2: poll error")
            return bool(device.ready), [0] if device.ready else []

    def isOpened(self) -> bool:
        return self.open

    def getBackendName(self) -> str:
        return "V4L2"

    def get(self, prop: int) -> float:
        if prop == cv2.CAP_PROP_POS_MSEC:
            return 1000.0 + self.device.taken
        return self.device.values.get(prop, -1.0)

    def set(self, prop: int, value: float) -> bool:
        if prop not in self.device.stubborn:
            most = self.device.most.get(prop, float("inf"))
            self.device.values[prop] = float(min(round(value), most))
        return True

    def read(self) -> tuple[bool, Any]:
        return self.retrieve()

    def retrieve(self) -> tuple[bool, Any]:
        device = self.device
        with device.changed:
            if not (device.there and device.ready):
                return False, None
            device.ready -= 1
            device.taken += 1
            return True, np.full((48, 64, 3), device.taken, np.uint8)

    def release(self) -> None:
        self.open = False
