"""Vendors' libraries, the devices that they see, and the ports of this computer."""

import os
import socket
import sys
from collections.abc import Iterator
from contextlib import closing
from functools import partial

from cosmic.app.configuration.backends import named_backends
from cosmic.app.configuration.platform_file import PlatformFile
from cosmic.app.diagnosis.finding import Finding, State, carry_out, missing
from cosmic.daqco.hw.factory import make_library
from cosmic.frame.errors import ConfigError
from cosmic.frame.plugins import (
    Kind,
    find_backend,
    is_simulated,
    missing_packages,
    names,
    plugins,
)
from cosmic.mico.core.settings import ControllerSettings, MicoSettings
from cosmic.mico.hw.factory import make_controller
from cosmic.mico.hw.sdl_input import SdlSource
from cosmic.vico.hw.factory import make_camera_library
from cosmic.vico.hw.serial_port import list_ports

LIBRARIES = "Vendors' libraries"
PACKAGES = "Packages"
_LIBRARIES_OF_CONTROLLERS = ("scu3d", "smaractctl")
"""Looked for in any case: what else there is of controllers, only a platform file tells."""
PORTS = "Ports"


def hardware(file: PlatformFile) -> list[Finding]:
    """Look for every library and its devices; what the platform file names is needed."""
    cameras = {each.backend for each in file.vico.camera} if file.vico else set()
    boards = {each.backend for each in file.daqco.drivers} if file.daqco is not None else set()
    found = _controllers(file)
    for backend in names(Kind.BOARD):
        if backend != "simulated":
            found += _boards(backend, needed=backend in boards)
    for backend in names(Kind.CAMERA):
        if backend != "simulated":
            found += _cameras(backend, needed=backend in cameras)
    found += carry_out(LIBRARIES, "gamepads", _gamepads, needed=False)
    return found


def _controllers(file: PlatformFile) -> list[Finding]:
    """Look for the libraries of SmarAct, and for whatever controller the platform file names."""
    found: list[Finding] = []
    named = {each.backend: each for each in file.mico.controllers}
    for backend in dict.fromkeys((*_LIBRARIES_OF_CONTROLLERS, *named)):
        settings = named.get(backend)
        if settings is None or not is_simulated(Kind.CONTROLLER, backend):
            look = partial(_controller, backend, settings)
            found += carry_out(LIBRARIES, backend, look, needed=settings is not None)
    return found


def _controller(
    backend: str, settings: MicoSettings | ControllerSettings | None
) -> Iterator[Finding]:
    path = "" if settings is None else settings.library
    made = make_controller(
        backend,
        library_path=path,
        serials=() if settings is None else settings.serials,
        options={} if settings is None else settings.options,
    )
    with closing(made) as controller:
        serials = ", ".join(str(each) for each in controller.find_devices())
        where = f", {path or 'from where the system looks'}"
        where = where if backend in _LIBRARIES_OF_CONTROLLERS else ""
        found = f"{controller.name}{where}; devices: {serials or 'none'}"
    advice = "" if serials else "Switch the controllers on and look at their cables."
    state = State.GOOD if serials else missing(needed=settings is not None)
    yield Finding(LIBRARIES, backend, state, found, advice)


def brought(file: PlatformFile) -> Iterator[Finding]:
    """Look whether what the platform file names from other packages is there, and loads."""
    for each in missing_packages(file.platform.requires):
        yield Finding(PACKAGES, each, State.PROBLEM, "not installed", f"pip install '{each}'")
    for named in named_backends(file):
        packages = [each for each in plugins(named.kind) if each.name == named.name]
        if packages and all(each.package.startswith("cosmic ") for each in packages):
            continue
        what = f"{named.kind.word} {named.name}"
        try:
            find_backend(named.kind, named.name)
        except ConfigError as exc:
            yield Finding(PACKAGES, named.name, State.PROBLEM, f"{what}: not there", str(exc))
        else:
            yield Finding(PACKAGES, named.name, State.GOOD, f"{what}, of {packages[0].package}")


def _boards(backend: str, *, needed: bool) -> list[Finding]:
    def look() -> Iterator[Finding]:
        library = make_library(backend)
        there = ", ".join(each.name for each in library.list_boards())
        found = f"{library.name}; boards: {there or 'none'}"
        yield Finding(LIBRARIES, backend, State.GOOD, found)

    return carry_out(LIBRARIES, backend, look, needed=needed)


def _cameras(backend: str, *, needed: bool) -> list[Finding]:
    def look() -> Iterator[Finding]:
        with closing(make_camera_library(backend)) as library:
            keys = ", ".join(each.key for each in library.cameras())
            found = f"{library.name}; cameras: {keys or 'none'}"
        state = State.GOOD if keys or not needed else State.PROBLEM
        advice = "" if keys or not needed else "Look at cable, power and network of the camera."
        yield Finding(LIBRARIES, backend, state, found, advice)

    return carry_out(LIBRARIES, backend, look, needed=needed)


def _gamepads() -> Iterator[Finding]:
    with closing(SdlSource()) as source:
        names = ", ".join(each.title for each in source.devices())
    yield Finding(LIBRARIES, "gamepads", State.GOOD, names or "none connected")


def serial_ports(file: PlatformFile) -> Iterator[Finding]:
    """Look for serial ports, and whether they may be used."""
    there = list_ports()
    yield Finding(PORTS, "serial ports", State.GOOD, ", ".join(there) or "none")
    if sys.platform != "win32":
        for port in there:
            if not os.access(port, os.R_OK | os.W_OK):
                advice = (
                    "Join the group that owns it: sudo usermod -a -G dialout USER; log in anew."
                )
                yield Finding(PORTS, port, State.NOTE, "may not be used", advice)
    for name in _named_ports(file):
        if name not in there and not os.path.lexists(name):
            advice = "Look at the cable and its adapter, or change the port in the platform file."
            yield Finding(PORTS, name, State.PROBLEM, "named in the platform file, missing", advice)


def _named_ports(file: PlatformFile) -> list[str]:
    if file.vico is None:
        return []
    wanted = ((file.vico.lens, "navitar"), (file.vico.light, "brightlight"))
    return [each.port for each, backend in wanted if each.backend == backend]


def network(file: PlatformFile) -> Iterator[Finding]:
    """Look whether a station can listen where the platform file says."""
    _, _, address = file.network.listen.partition("/")
    host, _, number = address.rpartition(":")
    host, port = host.strip("[]"), int(number)
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family, socket.SOCK_STREAM) as listener:
        try:
            listener.bind((host, port))
        except OSError as exc:
            advice = (
                "Another program listens there, or the address is not of this computer: name "
                "another under [network] listen."
            )
            state = missing(needed=file.network.serve)
            yield Finding(PORTS, "network", state, f"{file.network.listen}: {exc.strerror}", advice)
            return
    yield Finding(PORTS, "network", State.GOOD, f"{file.network.listen} is free")
