"""Shutter, gain and trigger of an IIDC camera."""

from ctypes import byref

from cosmic.frame.errors import DeviceError
from cosmic.vico.hw import dc1394_ctypes as dc
from cosmic.vico.hw.dc1394_calls import Dc1394Handle
from cosmic.vico.hw.interface import Range, Trigger


class Dc1394Feature:
    """One number that can be set: in its own unit where the camera knows it, else in counts.

    Parameters
    ----------
    unit : float
        What one count is worth, for a camera without absolute values; 0 where nobody knows, which
        makes the feature unavailable.
    """

    def __init__(self, handle: Dc1394Handle, feature: int, unit: float) -> None:
        self._handle = handle
        self._feature = feature
        self._unit = unit
        self._absolute = False
        self.available = bool(handle.integer("dc1394_feature_is_present", feature))
        if not self.available:
            return
        handle.call("dc1394_feature_set_mode", feature, dc.DC1394_FEATURE_MODE_MANUAL)
        self._absolute = bool(handle.integer("dc1394_feature_has_absolute_control", feature))
        if self._absolute:
            handle.call("dc1394_feature_set_absolute_control", feature, dc.DC1394_ON)
        self.available = self._absolute or unit > 0.0

    def bounds(self) -> Range | None:
        """Return what it accepts, None where it cannot be set."""
        if not self.available:
            return None
        if self._absolute:
            name = "dc1394_feature_get_absolute_boundaries"
            return Range(*self._handle.floats(name, self._feature, count=2))
        name = "dc1394_feature_get_boundaries"
        low, high = self._handle.numbers(name, self._feature, count=2)
        return Range(low * self._unit, high * self._unit, self._unit)

    def read(self) -> float:
        """Return the value in force; 0 where there is none."""
        if not self.available:
            return 0.0
        if self._absolute:
            return self._handle.floats("dc1394_feature_get_absolute_value", self._feature)[0]
        return self._handle.numbers("dc1394_feature_get_value", self._feature)[0] * self._unit

    def write(self, value: float) -> None:
        """Set it; the caller has checked that it is available and within bounds."""
        if self._absolute:
            self._handle.call("dc1394_feature_set_absolute_value", self._feature, value)
        else:
            counts = round(value / self._unit)
            self._handle.call("dc1394_feature_set_value", self._feature, counts)


class Dc1394Trigger:
    """What starts an exposure."""

    def __init__(self, handle: Dc1394Handle) -> None:
        self._handle = handle
        self._sources = self._find_sources()
        self.choices = tuple(each for each in Trigger if each in {Trigger.FREE_RUN, *self._sources})
        self.choice = Trigger.FREE_RUN
        if self._sources:
            handle.call("dc1394_external_trigger_set_power", dc.DC1394_OFF)

    def write(self, choice: Trigger) -> None:
        """Put one of the choices in force."""
        if choice is Trigger.FREE_RUN:
            self._handle.call("dc1394_external_trigger_set_power", dc.DC1394_OFF)
        else:
            source = self._sources[choice]
            self._handle.call("dc1394_external_trigger_set_mode", dc.DC1394_TRIGGER_MODE_0)
            self._handle.call("dc1394_external_trigger_set_source", source)
            self._handle.call("dc1394_external_trigger_set_power", dc.DC1394_ON)
        self.choice = choice

    def fire(self) -> None:
        """Trigger by software."""
        self._handle.call("dc1394_software_trigger_set_power", dc.DC1394_ON)

    def _find_sources(self) -> dict[Trigger, int]:
        handle = self._handle
        if not handle.integer("dc1394_feature_is_present", dc.DC1394_FEATURE_TRIGGER):
            return {}
        found = dc.dc1394trigger_sources_t()
        try:
            handle.call("dc1394_external_trigger_get_supported_sources", byref(found))
        except DeviceError:
            return {}  # IIDC before 1.31 knows no sources
        codes = list(found.sources[: found.num])
        lines = [each for each in codes if each != dc.DC1394_TRIGGER_SOURCE_SOFTWARE]
        sources = {Trigger.HARDWARE: min(lines)} if lines else {}
        if dc.DC1394_TRIGGER_SOURCE_SOFTWARE in codes:
            sources[Trigger.SOFTWARE] = dc.DC1394_TRIGGER_SOURCE_SOFTWARE
        return sources
