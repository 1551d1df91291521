"""What platform.toml says about MiCo."""

from collections import Counter
from typing import Annotated, Self

from pydantic import Field, model_validator

from cosmic.frame.config import StrictModel, not_there
from cosmic.mico.core.motion.settings import (
    JogSettings,
    LinkSettings,
    MotionDefaults,
    PositionerSettings,
    Text,
    UndoSettings,
    WatchSettings,
    link_misfits,
)
from cosmic.mico.core.sequence.settings import InitialisationSettings, misfits
from cosmic.mico.core.teleoperation.settings import TeleoperationSettings
from cosmic.mico.core.trajectory.settings import MirrorSettings
from cosmic.mico.hw.interface import Channel, Serial

Names = Annotated[tuple[str, ...], Field(strict=False)]


class GroupSettings(StrictModel):
    """A group of positioners as the window arranges them."""

    title: Text
    positioners: Names


class ContactSettings(StrictModel):
    """What is to happen when two bodies would touch, in place of refusing the movement."""

    bodies: Annotated[tuple[str, str], Field(strict=False)]
    response: str = Field(min_length=1)
    options: dict[str, object] = Field(default_factory=dict)


class ControllerSettings(StrictModel):
    """One more controller library; its devices are numbered behind those before it."""

    backend: str = Field(min_length=1)
    library: str = ""
    options: dict[str, object] = Field(default_factory=dict)
    serials: Annotated[tuple[Serial, ...], Field(strict=False, min_length=1)]


class MicoSettings(StrictModel):
    """Section ``[mico]`` of platform.toml."""

    backend: str = Field(default="simulated", min_length=1)
    library: str = ""
    options: dict[str, object] = Field(default_factory=dict)
    serials: Annotated[tuple[Serial, ...], Field(strict=False)] = ()
    controller: Annotated[tuple[ControllerSettings, ...], Field(strict=False)] = ()
    defaults: MotionDefaults = MotionDefaults()
    jog: JogSettings = JogSettings()
    undo: UndoSettings = UndoSettings()
    watch: WatchSettings = WatchSettings()
    initialisation: InitialisationSettings = InitialisationSettings()
    poses: str = "poses.toml"
    mirror: MirrorSettings = MirrorSettings()
    teleoperation: TeleoperationSettings = TeleoperationSettings()
    positioner: Annotated[tuple[PositionerSettings, ...], Field(strict=False)]
    group: Annotated[tuple[GroupSettings, ...], Field(strict=False)] = ()
    link: Annotated[tuple[LinkSettings, ...], Field(strict=False)] = ()
    contact: Annotated[tuple[ContactSettings, ...], Field(strict=False)] = ()

    @model_validator(mode="after")
    def _names_fit(self) -> Self:
        wrong = [
            *self._twice("name", [each.name for each in self.positioner]),
            *self._same_channel(),
            *self._twice("key", self._keys()),
            *self._twice("serial", [str(serial) for serial in self.all_serials]),
            *self._joined_wrongly(),
            *self._unknown_names(),
            *self.mirror.misfits(self.kinds),
            *link_misfits(self.link, self.kinds),
            *misfits(
                self.initialisation.step,
                self.kinds,
                tuple(group.title for group in self.group),
            ),
            *self.teleoperation.mistakes(self.kinds),
        ]
        if wrong:
            raise ValueError("; ".join(wrong))
        return self

    @property
    def all_serials(self) -> tuple[Serial, ...]:
        """Serial numbers of the devices of all controllers, in the order of their numbers."""
        return (*self.serials, *(serial for each in self.controller for serial in each.serials))

    def _joined_wrongly(self) -> list[str]:
        missing = "serials: name all devices, so that none takes another's number"
        found = [(each.backend, each.library, each.options) for each in self.controllers]
        twice = dict.fromkeys(
            f"controller {backend!r} is there twice with the same options, and would be opened "
            "twice: name all its serials in one place"
            for index, (backend, library, options) in enumerate(found)
            if (backend, library, options) in found[:index]
        )
        return [*([missing] if self.controller and not self.serials else []), *twice]

    @property
    def controllers(self) -> "tuple[MicoSettings | ControllerSettings, ...]":
        """What is said of each controller library, in the order of their devices."""
        return (self, *self.controller)

    @property
    def backends(self) -> tuple[str, ...]:
        """Names of the backends of all controllers, in their order."""
        return tuple(each.backend for each in self.controllers)

    @property
    def kinds(self) -> dict[str, str]:
        """Kind of every positioner by name: "linear", "rotary" or "open-loop"."""
        return {each.name: each.kind for each in self.positioner}

    @property
    def start_regions(self) -> dict[str, tuple[float, float]]:
        """Where each axis may stand at power-up; those that may stand anywhere are left out."""
        regions = {each.name: each.start_region for each in self.positioner}
        return {name: region for name, region in regions.items() if region is not None}

    def _keys(self) -> list[str]:
        keys = [key for each in self.positioner for key in (each.forward_key, each.backward_key)]
        return [key.upper() for key in keys if key]

    @staticmethod
    def _twice(what: str, values: list[str]) -> list[str]:
        return [
            f"{what} {value!r} is used {count} times"
            for value, count in Counter(values).items()
            if count > 1
        ]

    def _same_channel(self) -> list[str]:
        names: dict[Channel, list[str]] = {}
        for each in self.positioner:
            names.setdefault(each.address, []).append(each.name)
        return [
            f"{' and '.join(group)} are both on device {where.device} channel {where.channel}"
            for where, group in names.items()
            if len(group) > 1
        ]

    def _unknown_names(self) -> list[str]:
        known = [each.name for each in self.positioner]
        used = [(f"group {group.title!r}", group.positioners) for group in self.group]
        return [
            f"{where}: {not_there('positioner', name, known)}"
            for where, names in used
            for name in names
            if name not in known
        ]
