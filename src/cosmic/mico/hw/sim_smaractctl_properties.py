"""The properties of the simulated MCS2: of channels, of modules, of the device and of the API."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Generic, Protocol, TypeVar

from cosmic.mico.hw import smaractctl_ctypes as sa
from cosmic.mico.hw.sim_smaractctl_channel import NOTHING_MOVES, Channel
from cosmic.mico.hw.sim_smaractctl_types import TYPE_NAMES, WRITABLE_TYPES, Phase, Refused
from cosmic.twin.settings import ControllerSettings

I32: Final = sa.SA_CTL_DTYPE_INT32
I64: Final = sa.SA_CTL_DTYPE_INT64
TEXT: Final = sa.SA_CTL_DTYPE_STRING
_FAR: Final = 10**14
_INT32: Final = 2**31 - 1

Value = int | str
T = TypeVar("T")


@dataclass(frozen=True)
class Property(Generic[T]):
    """One property of a channel, or of the whole device.

    Attributes
    ----------
    dtype : int
        Type of its value, as the header counts them.
    read : callable
        Takes what it belongs to and the time.
    write : callable or None
        Takes what it belongs to, the value and the time; None where it can only be read.
    default : int
        What it is at power-up.
    low, high : int
        The values that it takes.
    """

    dtype: int
    read: Callable[[T, float], Value]
    write: Callable[[T, Value, float], None] | None = None
    default: int = 0
    low: int = -_INT32 - 1
    high: int = _INT32

    def set(self, owner: T, value: Value, now_s: float) -> None:
        """Write it, or refuse as the controller does."""
        if self.write is None:
            raise Refused(sa.SA_CTL_ERROR_PERMISSION_DENIED)
        if isinstance(value, str) != (self.dtype == TEXT):
            raise Refused(sa.SA_CTL_ERROR_INVALID_DATA_TYPE)
        if isinstance(value, int) and not self.low <= value <= self.high:
            raise Refused(sa.SA_CTL_ERROR_INVALID_PARAMETER)
        self.write(owner, value, now_s)


def _kept(
    key: int, dtype: int, default: int = 0, low: int = 0, high: int = _INT32
) -> Property[Channel]:
    """Return a property that is stored until the power goes."""

    def read(channel: Channel, _now_s: float) -> int:
        return channel.value(key)

    def write(channel: Channel, value: Value, _now_s: float) -> None:
        channel.values[key] = int(value)

    return Property(dtype, read, write, default, low, high)


def _read_only(dtype: int, read: Callable[[Channel, float], Value]) -> Property[Channel]:
    return Property(dtype, read)


def _set_velocity(channel: Channel, value: Value, _now_s: float) -> None:
    before = channel.value(sa.SA_CTL_PKEY_MOVE_VELOCITY)
    if channel.phase not in NOTHING_MOVES and bool(before) != bool(value):
        raise Refused(sa.SA_CTL_ERROR_BUSY_MOVING)
    channel.values[sa.SA_CTL_PKEY_MOVE_VELOCITY] = int(value)


def _set_type(channel: Channel, value: Value, now_s: float) -> None:
    if value not in WRITABLE_TYPES:
        raise Refused(sa.SA_CTL_ERROR_INVALID_PARAMETER)
    channel.forget(now_s)
    channel.type_code = int(value)
    channel.post(sa.SA_CTL_EVENT_POSITIONER_TYPE_CHANGED, int(value), now_s)


def _set_scale(key: int) -> Callable[[Channel, Value, float], None]:
    def write(channel: Channel, value: Value, _now_s: float) -> None:
        channel.values[key] = int(value)
        channel.rescale()

    return write


def _set_power(channel: Channel, value: Value, now_s: float) -> None:
    channel.values[sa.SA_CTL_PKEY_SENSOR_POWER_MODE] = int(value)
    if value == sa.SA_CTL_SENSOR_MODE_DISABLED and channel.phase is not Phase.OPEN_LOOP:
        channel.interrupt(sa.SA_CTL_ERROR_SENSOR_DISABLED, now_s)


def _set_amplifier(channel: Channel, value: Value, now_s: float) -> None:
    channel.values[sa.SA_CTL_PKEY_AMPLIFIER_ENABLED] = int(value)
    if not value:
        channel.interrupt(sa.SA_CTL_ERROR_AMPLIFIER_DISABLED, now_s)


def _read_target(channel: Channel, now_s: float) -> int:
    channel.require_sensor()
    return channel.counts(now_s) if channel.target is None else channel.target


def _take_error(channel: Channel, _now_s: float) -> int:
    code, channel.error = channel.error, 0
    return code


def _base_unit(channel: Channel, _now_s: float) -> int:
    return sa.SA_CTL_UNIT_METER if channel.stage.unit == "um" else sa.SA_CTL_UNIT_DEGREE


def _type_name(channel: Channel, _now_s: float) -> str:
    known = TYPE_NAMES.get(channel.type_code)
    return known.name if known is not None else "Custom"


def _of_type(what: str) -> Callable[[Channel, float], int]:
    def read(channel: Channel, _now_s: float) -> int:
        known = TYPE_NAMES.get(channel.type_code)
        return 0 if known is None else int(getattr(known, what))

    return read


class PropertyHolder(Protocol):
    """A controller whose properties are read and written; in its lock."""

    serial: str
    name: str
    settings: ControllerSettings
    values: dict[int, int]
    channels: list[Channel]
    modules: int

    def channel(self, index: int) -> Channel:
        """Return a channel; raises `Refused` where there is none."""
        ...


_VELOCITY: Final = _kept(sa.SA_CTL_PKEY_MOVE_VELOCITY, I64, 0, 0, 10**11)
_POWER: Final = _kept(sa.SA_CTL_PKEY_SENSOR_POWER_MODE, I32, 1, 0, 2)
_AMPLIFIER: Final = _kept(sa.SA_CTL_PKEY_AMPLIFIER_ENABLED, I32, 1, 0, 1)
_OFFSET: Final = sa.SA_CTL_PKEY_LOGICAL_SCALE_OFFSET
_INVERSION: Final = sa.SA_CTL_PKEY_LOGICAL_SCALE_INVERSION
_STORED: Final[dict[int, tuple[int, int, int, int]]] = {
    sa.SA_CTL_PKEY_MOVE_MODE: (I32, 0, 0, 4),
    sa.SA_CTL_PKEY_MOVE_ACCELERATION: (I64, 0, 0, 10**13),
    sa.SA_CTL_PKEY_STEP_FREQUENCY: (I32, 1000, 1, 20_000),
    sa.SA_CTL_PKEY_STEP_AMPLITUDE: (I32, 65_535, 1, 65_535),
    sa.SA_CTL_PKEY_MAX_CL_FREQUENCY: (I32, 5000, 50, 20_000),
    sa.SA_CTL_PKEY_DEFAULT_MAX_CL_FREQUENCY: (I32, 5000, 50, 20_000),
    sa.SA_CTL_PKEY_HOLD_TIME: (I32, -1, -1, _INT32),
    sa.SA_CTL_PKEY_SCAN_VELOCITY: (I64, 65_535, 1, 65_535_000_000),
    sa.SA_CTL_PKEY_RANGE_LIMIT_MIN: (I64, 0, -_FAR, _FAR),
    sa.SA_CTL_PKEY_RANGE_LIMIT_MAX: (I64, 0, -_FAR, _FAR),
    sa.SA_CTL_PKEY_DEFAULT_RANGE_LIMIT_MIN: (I64, 0, -_FAR, _FAR),
    sa.SA_CTL_PKEY_DEFAULT_RANGE_LIMIT_MAX: (I64, 0, -_FAR, _FAR),
    sa.SA_CTL_PKEY_SENSOR_POWER_SAVE_DELAY: (I32, 100, 0, 5000),
    sa.SA_CTL_PKEY_REFERENCING_OPTIONS: (I32, 0, 0, _INT32),
    sa.SA_CTL_PKEY_CALIBRATION_OPTIONS: (I32, 0, 0, 0x1FF),
    sa.SA_CTL_PKEY_SAFE_DIRECTION: (I32, 1, 0, 1),
    sa.SA_CTL_PKEY_FOLLOWING_ERROR_LIMIT: (I64, 0, 0, _FAR),
    sa.SA_CTL_PKEY_POSITIONER_CONTROL_OPTIONS: (I32, 0, 0, _INT32),
    sa.SA_CTL_PKEY_CONTROL_LOOP_INPUT: (I32, 1, 0, 2),
    sa.SA_CTL_PKEY_BROADCAST_STOP_OPTIONS: (I32, 0, 0, _INT32),
    sa.SA_CTL_PKEY_POSITION_MEAN_SHIFT: (I32, 0, 0, 12),
    sa.SA_CTL_PKEY_POS_P_GAIN: (I32, 30, 0, _INT32),
    sa.SA_CTL_PKEY_POS_I_GAIN: (I32, 0, 0, _INT32),
    sa.SA_CTL_PKEY_POS_D_GAIN: (I32, 0, 0, _INT32),
}
CHANNEL: Final[dict[int, Property[Channel]]] = {
    **{key: _kept(key, *rest) for key, rest in _STORED.items()},
    sa.SA_CTL_PKEY_MOVE_VELOCITY: Property(I64, _VELOCITY.read, _set_velocity, 0, 0, 10**11),
    sa.SA_CTL_PKEY_CHANNEL_STATE: _read_only(I32, lambda channel, _now_s: channel.state),
    sa.SA_CTL_PKEY_CHANNEL_TYPE: _read_only(I32, lambda *_: sa.SA_CTL_STICK_SLIP_PIEZO_DRIVER),
    sa.SA_CTL_PKEY_POSITION: Property(
        I64,
        lambda channel, now_s: channel.counts(now_s),
        lambda channel, value, now_s: channel.show(now_s, int(value)),
        0,
        -_FAR,
        _FAR,
    ),
    sa.SA_CTL_PKEY_TARGET_POSITION: _read_only(I64, _read_target),
    sa.SA_CTL_PKEY_SCAN_POSITION: _read_only(I64, lambda channel, _now_s: channel.scan),
    _OFFSET: Property(
        I64, lambda channel, _: channel.value(_OFFSET), _set_scale(_OFFSET), 0, -_FAR, _FAR
    ),
    _INVERSION: Property(
        I32, lambda channel, _: channel.value(_INVERSION), _set_scale(_INVERSION), 0, 0, 1
    ),
    sa.SA_CTL_PKEY_POSITIONER_TYPE: Property(
        I32, lambda channel, _now_s: channel.type_code, _set_type, 0, 0, _INT32
    ),
    sa.SA_CTL_PKEY_POSITIONER_TYPE_NAME: _read_only(TEXT, _type_name),
    sa.SA_CTL_PKEY_POS_BASE_UNIT: _read_only(I32, _base_unit),
    sa.SA_CTL_PKEY_POS_BASE_RESOLUTION: _read_only(
        I32, lambda channel, _now_s: -12 if channel.stage.unit == "um" else -9
    ),
    sa.SA_CTL_PKEY_POS_MOVEMENT_TYPE: _read_only(I32, _of_type("movement")),
    sa.SA_CTL_PKEY_POS_REFERENCE_TYPE: _read_only(I32, _of_type("reference")),
    sa.SA_CTL_PKEY_POS_IS_CUSTOM_TYPE: _read_only(I32, lambda *_: 0),
    sa.SA_CTL_PKEY_SENSOR_POWER_MODE: Property(I32, _POWER.read, _set_power, 1, 0, 2),
    sa.SA_CTL_PKEY_AMPLIFIER_ENABLED: Property(I32, _AMPLIFIER.read, _set_amplifier, 1, 0, 1),
    sa.SA_CTL_PKEY_FOLLOWING_ERROR: _read_only(I64, lambda *_: 0),
    sa.SA_CTL_PKEY_CHANNEL_ERROR: _read_only(I32, _take_error),
    sa.SA_CTL_PKEY_CHANNEL_TEMPERATURE: _read_only(
        I32,
        lambda channel, _now_s: (
            channel.settings.temperature_hot_deg_c
            if channel.fault("overheated")
            else channel.settings.temperature_deg_c
        ),
    ),
}

_MODULE: Final = {
    sa.SA_CTL_PKEY_MODULE_STATE: Property[PropertyHolder](
        I32, lambda *_: sa.SA_CTL_MOD_STATE_BIT_SM_PRESENT
    ),
    sa.SA_CTL_PKEY_POWER_SUPPLY_ENABLED: Property[PropertyHolder](I32, lambda *_: 1),
    sa.SA_CTL_PKEY_NUMBER_OF_BUS_MODULE_CHANNELS: Property[PropertyHolder](I32, lambda *_: 3),
    sa.SA_CTL_PKEY_BUS_MODULE_TYPE: Property[PropertyHolder](I32, lambda *_: 1),
    sa.SA_CTL_PKEY_BUS_MODULE_TEMPERATURE: Property[PropertyHolder](
        I32, lambda device, _now_s: device.settings.temperature_deg_c
    ),
}


def _rename(device: PropertyHolder, value: Value, _now_s: float) -> None:
    device.name = str(value)[: sa.SA_CTL_STRING_MAX_LENGTH]


def _stored(key: int, default: int, high: int) -> Property[PropertyHolder]:
    def read(device: PropertyHolder, _now_s: float) -> int:
        return device.values.get(key, default)

    def write(device: PropertyHolder, value: Value, _now_s: float) -> None:
        device.values[key] = int(value)

    return Property(I32, read, write, default, 0, high)


_DEVICE: Final = {
    sa.SA_CTL_PKEY_NUMBER_OF_CHANNELS: Property[PropertyHolder](
        I32, lambda device, _now_s: len(device.channels)
    ),
    sa.SA_CTL_PKEY_NUMBER_OF_BUS_MODULES: Property[PropertyHolder](
        I32, lambda device, _now_s: device.modules
    ),
    sa.SA_CTL_PKEY_INTERFACE_TYPE: Property[PropertyHolder](I32, lambda *_: 1),
    sa.SA_CTL_PKEY_DEVICE_STATE: Property[PropertyHolder](I32, lambda *_: 0),
    sa.SA_CTL_PKEY_DEVICE_SERIAL_NUMBER: Property[PropertyHolder](
        TEXT, lambda device, _now_s: device.serial
    ),
    sa.SA_CTL_PKEY_DEVICE_NAME: Property[PropertyHolder](
        TEXT, lambda device, _now_s: device.name, _rename
    ),
    sa.SA_CTL_PKEY_EMERGENCY_STOP_MODE: _stored(sa.SA_CTL_PKEY_EMERGENCY_STOP_MODE, 0, 2),
    sa.SA_CTL_PKEY_NETWORK_DISCOVER_MODE: _stored(sa.SA_CTL_PKEY_NETWORK_DISCOVER_MODE, 2, 2),
    sa.SA_CTL_PKEY_STREAM_BASE_RATE: _stored(sa.SA_CTL_PKEY_STREAM_BASE_RATE, 1000, 1000),
    sa.SA_CTL_PKEY_STREAM_EXT_SYNC_RATE: _stored(sa.SA_CTL_PKEY_STREAM_EXT_SYNC_RATE, 1, 1000),
    sa.SA_CTL_PKEY_STREAM_OPTIONS: _stored(sa.SA_CTL_PKEY_STREAM_OPTIONS, 0, 1),
    sa.SA_CTL_PKEY_EVENT_NOTIFICATION_OPTIONS: _stored(
        sa.SA_CTL_PKEY_EVENT_NOTIFICATION_OPTIONS, 0, 1
    ),
    sa.SA_CTL_PKEY_AUTO_RECONNECT: _stored(sa.SA_CTL_PKEY_AUTO_RECONNECT, 0, 1),
}
_KNOWN: Final = frozenset(
    value for name, value in vars(sa).items() if name.startswith("SA_CTL_PKEY_")
)


def power_up(channel: Channel) -> None:
    """Give a channel the values that its properties have at power-up."""
    for key, each in CHANNEL.items():
        if each.write is not None and each.dtype != TEXT:
            channel.values.setdefault(key, each.default)


def read(device: PropertyHolder, index: int, key: int, now_s: float) -> tuple[int, Value]:
    """Return type and value of a property; raises `Refused`."""
    if key in CHANNEL:
        prop = CHANNEL[key]
        return prop.dtype, prop.read(device.channel(index), now_s)
    of_device = _device_property(device, index, key)
    return of_device.dtype, of_device.read(device, now_s)


def write(device: PropertyHolder, index: int, key: int, value: Value, now_s: float) -> None:
    """Write a property; raises `Refused`."""
    if key in CHANNEL:
        CHANNEL[key].set(device.channel(index), value, now_s)
    else:
        _device_property(device, index, key).set(device, value, now_s)


def _device_property(device: PropertyHolder, index: int, key: int) -> Property[PropertyHolder]:
    if key in _MODULE:
        if not 0 <= index < device.modules:
            raise Refused(sa.SA_CTL_ERROR_INVALID_MODULE_INDEX)
        return _MODULE[key]
    if key in _DEVICE:
        return _DEVICE[key]
    known = key in _KNOWN
    raise Refused(sa.SA_CTL_ERROR_FEATURE_NOT_SUPPORTED if known else sa.SA_CTL_ERROR_INVALID_KEY)
