"""All input devices there are, of every kind."""

import logging
from dataclasses import dataclass, field

from typing_extensions import override

from cosmic.frame.errors import NotConnectedError
from cosmic.mico.hw.input_device import InputDevice, InputInfo, InputSource
from cosmic.mico.hw.keyboard_input import KeyboardSource
from cosmic.mico.hw.recorded_input import RecordedSource
from cosmic.mico.hw.sdl_input import SdlSource
from cosmic.mico.hw.sim_haptic import SimHapticSource

logger = logging.getLogger(__name__)


@dataclass
class InputSources(InputSource):
    """Gamepads and joysticks, keys, recordings and, where motion is simulated, a haptic device."""

    simulated: bool = True
    keys: KeyboardSource = field(default_factory=KeyboardSource)
    haptics: SimHapticSource = field(default_factory=SimHapticSource)
    sticks: InputSource = field(default_factory=SdlSource)
    recordings: RecordedSource = field(default_factory=RecordedSource)
    problem: str = ""
    """Why sticks cannot be looked for; empty when they can."""

    @override
    def devices(self) -> tuple[InputInfo, ...]:
        found: tuple[InputInfo, ...] = ()
        try:
            found = self.sticks.devices()
            self.problem = ""
        except NotConnectedError as exc:
            if str(exc) != self.problem:
                self.problem = str(exc)
                logger.warning("%s", exc)
        if self.simulated:
            found += self.haptics.devices()
        return found + self.keys.devices()

    @override
    def open(self, key: str) -> InputDevice:
        kind, _, _ = key.partition(":")
        sources: dict[str, InputSource] = {
            "sdl": self.sticks,
            "recorded": self.recordings,
            "keyboard": self.keys,
        }
        if self.simulated:
            sources["haptic"] = self.haptics
        source = sources.get(kind)
        if source is None:
            raise NotConnectedError(f"there is no input device {key!r}; devices() lists them")
        return source.open(key)

    @override
    def close(self) -> None:
        self.sticks.close()
