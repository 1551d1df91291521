"""All input devices there are, of every kind."""

import logging
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from typing_extensions import override

from cosmic.frame.errors import CosmicError, NotConnectedError, PluginError
from cosmic.frame.plugins import Kind, find_backend, make
from cosmic.mico.hw.input_device import InputDevice, InputInfo, InputSource
from cosmic.mico.hw.keyboard_input import KeyboardSource
from cosmic.mico.hw.recorded_input import RecordedSource
from cosmic.mico.hw.sim_haptic import SimHapticSource

logger = logging.getLogger(__name__)


def _sticks() -> InputSource:
    source: InputSource = make(Kind.INPUT, "sdl", None)
    return source


def _keys() -> KeyboardSource:
    source: KeyboardSource = make(Kind.INPUT, "keyboard", None)
    return source


def _haptics() -> SimHapticSource:
    source: SimHapticSource = make(Kind.INPUT, "haptic", None)
    return source


def _recordings() -> RecordedSource:
    source: RecordedSource = make(Kind.INPUT, "recorded", None)
    return source


@dataclass
class InputSources(InputSource):
    """Gamepads and joysticks, keys, recordings, what is brought, and a simulated haptic device.

    Attributes
    ----------
    simulated : bool
        Motion is simulated: a simulated device may steer it.
    brought : mapping of str to InputSource
        Those of other packages, by the name that their keys begin with.
    problem : str
        Why some devices cannot be looked for; empty when all can.
    """

    simulated: bool = True
    keys: KeyboardSource = field(default_factory=_keys)
    haptics: SimHapticSource = field(default_factory=_haptics)
    sticks: InputSource = field(default_factory=_sticks)
    recordings: RecordedSource = field(default_factory=_recordings)
    brought: Mapping[str, InputSource] = field(default_factory=dict)
    problem: str = ""

    @override
    def devices(self) -> tuple[InputInfo, ...]:
        problems: list[str] = []
        found = self._look(self.sticks, problems)
        for source in self.brought.values():
            found += self._look(source, problems)
        problem = "; ".join(problems)
        if problem and problem != self.problem:
            logger.warning("%s", problem)
        self.problem = problem
        if self.simulated:
            found += self.haptics.devices()
        return found + self.keys.devices()

    @staticmethod
    def _look(source: InputSource, problems: list[str]) -> tuple[InputInfo, ...]:
        try:
            return source.devices()
        except CosmicError as exc:
            problems.append(str(exc))
            return ()

    @override
    def open(self, key: str) -> InputDevice:
        kind, _, _ = key.partition(":")
        sources: dict[str, InputSource] = {
            **self.brought,
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
        for source in self.brought.values():
            source.close()


def make_sources(
    named: Iterable[str], options: Mapping[str, Mapping[str, object]], *, simulated: bool
) -> InputSources:
    """Return CoSMic's own sources and those `named`; one that cannot be loaded is left out.

    Raises
    ------
    ConfigError
        Nothing has a name, or its options are wrong.
    """
    brought: dict[str, InputSource] = {}
    for name in named:
        try:
            if simulated or not find_backend(Kind.INPUT, name).simulated:
                brought[name] = make(Kind.INPUT, name, None, options.get(name, {}))
        except PluginError as exc:
            logger.error("%s", exc)
    return InputSources(simulated=simulated, brought=brought)
