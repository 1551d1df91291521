"""Channel and system properties of the simulated controller."""

from typing import Final

from cosmic.mico.hw.scu3d_ctypes import (
    SA_ADVANCED_STEPPING_MODE_ENABLED_PROP,
    SA_DEFAULT_MAX_CLOSED_LOOP_FREQUENCY_PROP,
    SA_HARDWARE_VERSION_CODE_PROP,
    SA_INTERNAL_TEMPERATURE_PROP,
    SA_INTERNAL_VOLTAGE_PROP,
    SA_KP_PROP,
    SA_KPD_PROP,
    SA_TARGET_READCHED_THRESHOLD_PROP,
)
from cosmic.mico.hw.sim_scu3d_channel import Channel
from cosmic.mico.hw.sim_scu3d_device import Device

MOVEMENT_TYPE_PROP: Final = 25
"""Since 1.5.16 only, hence not in the header; cannot be set."""

# attribute of the channel, smallest and largest value
_STORED: Final[dict[int, tuple[str, int, int]]] = {
    SA_TARGET_READCHED_THRESHOLD_PROP: ("threshold_fine", 1, 2**31 - 1),
    SA_KP_PROP: ("p_gain", 1, 127),
    SA_KPD_PROP: ("p_gain_divisor", 0, 10),
    SA_DEFAULT_MAX_CLOSED_LOOP_FREQUENCY_PROP: ("default_frequency_hz", 1, 18_500),
    SA_ADVANCED_STEPPING_MODE_ENABLED_PROP: ("advanced_stepping", 0, 1),
}
SYSTEM_KEYS: Final = (
    SA_INTERNAL_TEMPERATURE_PROP,
    SA_INTERNAL_VOLTAGE_PROP,
    SA_HARDWARE_VERSION_CODE_PROP,
)


def property_fits(key: int, value: int | None = None) -> bool:
    """Return whether the property exists and, with a value, can be set to it."""
    if value is None:
        return key in _STORED or key == MOVEMENT_TYPE_PROP
    if key not in _STORED:
        return False
    _, low, high = _STORED[key]
    return low <= value <= high


def get_property(channel: Channel, _now_s: float, key: int) -> tuple[int, ...]:
    """Return the value of a channel property that exists."""
    if key == MOVEMENT_TYPE_PROP:
        return (int(channel.movement),)
    return (int(getattr(channel, _STORED[key][0])),)


def set_property(channel: Channel, _now_s: float, key: int, value: int) -> tuple[int, ...]:
    """Set a channel property that exists to a value that fits."""
    setattr(channel, _STORED[key][0], value)
    return ()


def system_property(device: Device, key: int) -> int:
    """Return a system property that exists: degC, 0.1 V or a number."""
    settings = device.settings
    if key == SA_INTERNAL_TEMPERATURE_PROP:
        hot = device.faults.find("overheated", device.number)
        return settings.temperature_hot_deg_c if hot else settings.temperature_deg_c
    if key == SA_INTERNAL_VOLTAGE_PROP:
        out_of_range = any(channel.hv_error for channel in device.channels)
        return settings.rail_fault_dv if out_of_range else settings.rail_dv
    return settings.hardware_version
