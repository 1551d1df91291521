"""Numbers and times of the frames that Aravis hands over; plain arithmetic."""

from typing import Final

_WRAP: Final = 65536
_PLAUSIBLE_GAP: Final = 1000
_OLDEST_S: Final = 5.0
# Two crystals differ by less than this; the smallest delay seen is forgotten as slowly.
_DRIFT: Final = 2e-4


class FrameNumbers:
    """Makes numbers without end of the frame numbers on the wire, and counts what is missing.

    GigE Vision counts in 16 bit from 1 and leaves 0 out; Aravis' own fake camera does not, and
    USB3 Vision and the extended form of GigE Vision count in 64 bit. An incomplete frame whose
    first packet was lost bears the number of a frame that was in its buffer before.
    """

    def __init__(self) -> None:
        self._received = 0
        self._next = 0
        self._anchor: tuple[int, int] | None = None  # number on the wire, number given
        self._has_zero = False

    @property
    def lost(self) -> int:
        """How many numbers between the first and the last frame never came."""
        return self._next - self._received

    def whole(self, raw: int) -> int:
        """Return the number of a frame that came whole."""
        number = self._given(raw)
        if number is None:
            number = self._next
        self._has_zero |= raw == 0
        self._anchor = (raw, number)
        return self._counted(number)

    def doubtful(self, raw: int) -> int:
        """Return the number of an incomplete frame; the next one in order if it cannot be."""
        number = self._given(raw)
        if number is None or number >= self._next + _PLAUSIBLE_GAP:
            number = self._next
        return self._counted(number)

    def _given(self, raw: int) -> int | None:
        if self._anchor is None:
            return None
        last, number = self._anchor
        step = raw - last
        if step < -_WRAP // 2 and last < _WRAP:
            step += _WRAP if self._has_zero or raw == 0 else _WRAP - 1
        return number + step if number + step >= self._next else None

    def _counted(self, number: int) -> int:
        self._received += 1
        self._next = number + 1
        return number


class FrameTimes:
    """Tells when a frame was complete and when its exposure began, on the platform's clock.

    Aravis stamps a frame with this computer's time when its first packet is seen. What delays
    that (a busy computer) shows as a growing distance to the camera's own clock, and is taken off.
    """

    def __init__(self) -> None:
        self._transfer_s = _OLDEST_S
        self._nearest: tuple[int, int] | None = None  # smallest distance of the clocks, when; ns

    def complete_s(self, now_s: float, age_s: float, rate: float) -> float:
        """Return when it was complete, if it is `now_s` and its first packet came `age_s` ago."""
        age_s = min(max(age_s, 0.0), _OLDEST_S)
        self._transfer_s = min(self._transfer_s, age_s)
        return now_s - (age_s - self._transfer_s) * rate

    def delay_s(self, system_ns: int, device_ns: int) -> float:
        """Return how much later than others its first packet was seen, by the camera's clock."""
        distance = system_ns - device_ns
        if device_ns == 0:
            return 0.0
        if self._nearest is None:
            self._nearest = (distance, device_ns)
            return 0.0
        nearest, when = self._nearest
        nearest += round(max(0, device_ns - when) * _DRIFT)
        if abs(distance - nearest) > _OLDEST_S * 1e9:  # one of the clocks was set
            nearest = distance
        self._nearest = (min(nearest, distance), device_ns)
        return max(0.0, (distance - nearest) / 1e9)
