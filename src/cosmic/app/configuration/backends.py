"""Everything that a platform file names and a package brings, in one list."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import chain

from cosmic.app.configuration.platform_file import KNOWN_APPLICATIONS, PlatformFile
from cosmic.frame.plugins import Kind
from cosmic.mico.core.settings import MicoSettings
from cosmic.vico.core.settings import VicoSettings
from cosmic.vico.hw.factory import NONE


@dataclass(frozen=True, slots=True)
class NamedBackend:
    """A name in a platform file, and what the file says of it.

    Attributes
    ----------
    section : str
        Where it stands, such as "mico.controller[0]".
    options : mapping of str to object
        Its own settings, not checked.
    """

    section: str
    kind: Kind
    name: str
    options: Mapping[str, object] = field(default_factory=dict)


def named_backends(file: PlatformFile) -> Iterator[NamedBackend]:
    """Yield all that is named, in the order of the file; nothing is loaded."""
    yield from _of_mico(file.mico)
    if file.daqco is not None:
        for each in file.daqco.drivers:
            yield NamedBackend("daqco", Kind.BOARD, each.backend, each.options)
    if file.vico is not None:
        yield from _of_vico(file.vico)
    for name in file.platform.applications:
        if name not in KNOWN_APPLICATIONS:
            options = file.application.get(name, {})
            yield NamedBackend("application", Kind.APPLICATION, name, options)


def _of_mico(settings: MicoSettings) -> Iterator[NamedBackend]:
    yield NamedBackend("mico", Kind.CONTROLLER, settings.backend, settings.options)
    for index, each in enumerate(settings.controller):
        where = f"mico.controller[{index}]"
        yield NamedBackend(where, Kind.CONTROLLER, each.backend, each.options)
    for index, contact in enumerate(settings.contact):
        where = f"mico.contact[{index}]"
        yield NamedBackend(where, Kind.CONTACT, contact.response, contact.options)
    for index, positioner in enumerate(settings.positioner):
        if positioner.type:
            where = f"mico.positioner[{index}].type"
            yield NamedBackend(where, Kind.POSITIONER, positioner.type)
    steering = settings.teleoperation
    for name in steering.inputs:
        options = steering.input.get(name, {})
        yield NamedBackend("mico.teleoperation", Kind.INPUT, name, options)


def _of_vico(settings: VicoSettings) -> Iterator[NamedBackend]:
    backends = dict.fromkeys([*(each.backend for each in settings.camera), *settings.options])
    for name in backends:
        yield NamedBackend("vico", Kind.CAMERA, name, settings.options.get(name, {}))
    algorithms = chain.from_iterable(each.algorithms for each in settings.camera)
    for name in dict.fromkeys([*algorithms, *settings.analysis]):
        yield NamedBackend("vico", Kind.ANALYSIS, name, settings.analysis.get(name, {}))
    lens, light = settings.lens, settings.light
    if lens.backend != NONE:
        yield NamedBackend("vico.lens", Kind.LENS, lens.backend, lens.options)
    if light.backend != NONE:
        yield NamedBackend("vico.light", Kind.LIGHT, light.backend, light.options)
