"""Packages for stages, as their documentation describes them: pylablib's classes and PI's GCS.

Each device is laid out by letters as the other fakes: L linear, R rotary, N without a sensor.
Positions are in the unit of the library: metres and degrees for pylablib, millimetres and degrees
for PI. A movement goes on until it was asked about twice.
"""

from cosmic.mico.hw.pipython_stages import PiOptions
from cosmic.mico.hw.pylablib_stages import PylablibOptions

LAYOUTS = ("LLL", "LLL", "LLN", "RNN")
KINDS = {"L": "linear", "R": "rotary", "N": "open-loop"}
LOOKS = 2


class Axes:
    """Where the axes of one device are, and which of them move."""

    def __init__(self, names):
        self.position = dict.fromkeys(names, 0.0)
        self.looks = dict.fromkeys(names, 0)
        self.homed = dict.fromkeys(names, False)
        self.calls = []
        self.gone = False

    def check(self):
        if self.gone:
            raise ConnectionError("unplugged")

    def go(self, name, position):
        self.check()
        self.position[name] = position
        self.looks[name] = LOOKS

    def moving(self, name):
        self.check()
        self.looks[name] = max(0, self.looks[name] - 1)
        return self.looks[name] > 0


class RefusedError(Exception):
    """What pylablib's classes raise: its name tells a lost line from a refusal."""


class FakePylablib:
    """pylablib with two makes of stage, whose methods take their arguments in different orders."""

    version = "1.4.5"
    errors = (RefusedError, OSError, ValueError, RuntimeError)

    def __init__(self):
        self.devices = {}

    def device_class(self, name):
        return {"Thorlabs.KinesisMotor": self.kinesis, "Newport.Picomotor8742": self.picomotor}[
            name
        ]

    def kinesis(self, conn, scale="m"):
        self.devices[conn] = device = _Kinesis(Axes(range(3)))
        return device

    def picomotor(self, conn):
        self.devices[conn] = device = _Picomotor(Axes(range(3)))
        return device

    def controller_options(self):
        stages = [
            {
                "serial": 701 + number,
                "device": "Newport.Picomotor8742" if layout == "RNN" else "Thorlabs.KinesisMotor",
                "arguments": [f"2700000{number}"],
                "axes": [
                    {
                        "axis": axis,
                        "kind": KINDS[letter],
                        "unit": {"L": "m", "R": "deg", "N": "step"}[letter],
                    }
                    for axis, letter in enumerate(layout)
                ],
            }
            for number, layout in enumerate(LAYOUTS)
        ]
        return PylablibOptions.model_validate({"stages": stages})


class _Kinesis:
    """Position first, then the channel, as in `pylablib.devices.Thorlabs.kinesis`."""

    def __init__(self, axes):
        self.axes = axes

    def get_position(self, channel=None, scale=True):
        self.axes.check()
        return self.axes.position[channel]

    def move_to(self, position, channel=None, scale=True):
        self.axes.go(channel, position)

    def move_by(self, distance=1, channel=None, scale=True):
        self.axes.go(channel, self.axes.position[channel] + distance)

    def is_moving(self, channel=None):
        return self.axes.moving(channel)

    def is_homed(self, channel=None):
        self.axes.check()
        return self.axes.homed[channel]

    def home(self, sync=True, force=False, channel=None, timeout=None):
        assert not sync, "it would not return before it is there"
        self.axes.homed[channel] = True
        self.axes.go(channel, 0.0)

    def stop(self, immediate=False, sync=True, channel=None, timeout=None):
        self.axes.check()
        self.axes.calls.append(("stop", channel, immediate, sync))
        self.axes.looks[channel] = 0

    def close(self):
        self.axes.calls.append("close")


class _Picomotor:
    """The axis first, as in `pylablib.devices.Newport.picomotor`; it cannot be homed."""

    def __init__(self, axes):
        self.axes = axes

    def get_position(self, axis="all", addr=None):
        self.axes.check()
        return self.axes.position[axis]

    def move_to(self, axis, position, addr=None):
        self.axes.go(axis, position)

    def move_by(self, axis, steps=1, addr=None):
        self.axes.go(axis, self.axes.position[axis] + steps)

    def is_moving(self, axis="all", addr=None):
        return self.axes.moving(axis)

    def setup_velocity(self, axis="all", speed=None, accel=None, addr=None):
        self.axes.calls.append(("speed", axis, speed))

    def stop(self, axis="all", immediate=False, addr=None):
        self.axes.check()
        self.axes.calls.append(("stop", axis, immediate))
        self.axes.looks[axis] = 0

    def close(self):
        self.axes.calls.append("close")


class GCSError(Exception):
    """An error code of GCS."""

    def __init__(self, val):
        super().__init__(f"GCS error {val}")
        self.val = val


class FakePipython:
    """pipython: `GCSDevice` with the commands that its documentation lists."""

    version = "2.11.0"
    errors = (GCSError, OSError, ValueError, KeyError)

    def __init__(self):
        self.devices = {}

    def connect(self, options):
        self.devices[options.at] = device = _GcsDevice()
        return device, device.CloseConnection

    def controller_options(self):
        stages = [
            {
                "serial": f"01190{number}",
                "controller": "C-884",
                "at": f"01190{number}",
                "axes": [
                    {"axis": str(axis + 1), "kind": KINDS[letter]}
                    | ({"unit": "deg"} if letter == "R" else {})
                    for axis, letter in enumerate(layout)
                ],
            }
            for number, layout in enumerate(LAYOUTS)
        ]
        return PiOptions.model_validate({"stages": stages})


class _GcsDevice:
    def __init__(self):
        self.axes = Axes(["1", "2", "3"])
        self.servo = dict.fromkeys(self.axes.position, False)
        self.limit = 1e6

    def qIDN(self):
        return "(c)2015 Physik Instrumente (PI) GmbH & Co. KG, C-884.4DB, 0119, 1.2.3.4\n"

    def qPOS(self, axes=None):
        self.axes.check()
        return {axes: self.axes.position[axes]}

    def IsMoving(self, axes=None):
        return {axes: self.axes.moving(axes)}

    def qSVO(self, axes=None):
        return {axes: self.servo[axes]}

    def SVO(self, axes, values=None):
        self.servo[axes] = bool(values)

    def MOV(self, axes, values=None):
        if not self.servo[axes]:
            raise GCSError(5)
        if abs(values) > self.limit:
            raise GCSError(7)
        self.axes.go(axes, values)

    def MVR(self, axes, values=None):
        self.MOV(axes, self.axes.position[axes] + values)

    def OSM(self, channels, values=None):
        if self.servo[channels]:
            raise GCSError(5)
        self.axes.go(channels, self.axes.position[channels] + values)

    def FRF(self, axes=None):
        self.axes.homed[axes] = True
        self.axes.go(axes, 0.0)

    def qFRF(self, axes=None):
        return {axes: self.axes.homed[axes]}

    def HLT(self, axes=None, noraise=False):
        self.axes.check()
        self.axes.calls.append(("HLT", axes))
        self.axes.looks[axes] = 0
        if not noraise:
            raise GCSError(10)

    def CloseConnection(self):
        self.axes.calls.append("close")
