"""``cosmic serve``: a station without a window."""

import argparse
import logging
import sys
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path
from queue import Empty, SimpleQueue
from typing import Final

from cosmic.app.audit import PlatformAudit, audit_file
from cosmic.app.configuration.gateways import doors
from cosmic.app.configuration.network import Serving, serving
from cosmic.app.configuration.platform_file import check_applications, load_platform
from cosmic.app.platform import Platform, Uses, build_platform
from cosmic.app.rig import Rig
from cosmic.app.stations.address import StationAddress, stations_of
from cosmic.app.stations.host import StationHost
from cosmic.frame.errors import ConfigError, NotConnectedError
from cosmic.frame.hooks import install_hooks
from cosmic.frame.log import set_up_logging
from cosmic.frame.platform_services import ending_signals

logger = logging.getLogger(__name__)

LOOK_S: Final = 1.0
"""Windows tells of Ctrl+C only between two waits."""


@dataclass(frozen=True)
class ServeOptions:
    """What the command line says about a station.

    Attributes
    ----------
    applications : tuple of str
        Which to host; empty: all of the platform file.
    listen, name, certificates
        In place of what the platform file says in ``[network]``.
    stations : tuple of StationAddress
        Others that this one uses, so that a force limit here stops the motion there.
    http, epics : str or None
        Where HTTP listens, and what the names of EPICS begin with; in place of what the file says.
    """

    applications: tuple[str, ...] = ()
    config: Path | None = None
    listen: str | None = None
    name: str | None = None
    certificates: Path | None = None
    stations: tuple[StationAddress, ...] = ()
    rate: float = 1.0
    seed: int = 0
    cold: bool = False
    sample: str | None = None
    truth: Path | None = None
    world: str | None = None
    http: str | None = None
    epics: str | None = None


def run(chosen: argparse.Namespace) -> int:
    """Serve by the options of the command line; see `serve`."""
    return serve(
        ServeOptions(
            applications=chosen.applications,
            config=chosen.config,
            listen=chosen.listen,
            name=chosen.name,
            certificates=chosen.certificates,
            stations=stations_of(chosen),
            rate=1.0 if chosen.rate is None else chosen.rate,
            seed=chosen.seed,
            cold=chosen.cold,
            sample=chosen.sample,
            truth=chosen.truth,
            world=chosen.world,
            http=chosen.http,
            epics=chosen.epics,
        )
    )


def serve(options: ServeOptions) -> int:
    """Serve until a signal ends it, and return the exit code.

    Raises
    ------
    ConfigError
        The configuration or an option is wrong; nothing was opened.
    NotConnectedError
        The vendor library is not there, or no device answers.
    NotAvailable
        What stations need is not installed, or it cannot listen there.
    """
    file, path = load_platform(options.config)
    check_applications(options.applications, "--applications")
    how = serving(
        file.network,
        file.platform.name,
        path.parent,
        listen=options.listen,
        name=options.name,
        certificates=options.certificates,
    )
    opened = doors(file.network.http, file.network.epics, listen=options.http, prefix=options.epics)
    with ExitStack() as at_end:
        at_end.callback(set_up_logging(console=True))
        # A signal may come while its own wait holds what an `Event` needs to be set.
        ended: SimpleQueue[str] = SimpleQueue()
        at_end.enter_context(ending_signals(ended.put))
        platform = _build(options, how, options.applications or file.platform.applications)
        at_end.callback(platform.shut_down)
        at_end.callback(install_hooks(platform.policy))
        platform.initialize()
        if platform.failure:
            raise NotConnectedError(platform.failure)
        audit = at_end.enter_context(PlatformAudit(platform, audit_file()))
        rig = Rig(platform, "campaigns")
        at_end.callback(rig.close)
        host = StationHost(platform, how, opened, audit)
        host.use_rig(rig)
        at_end.callback(host.close)  # first of all, so that nobody is answered any more
        sys.stdout.write("\n".join((host.address, *host.gateways, "")))
        sys.stdout.flush()
        _await_end(ended)
    return 0


def _build(options: ServeOptions, how: Serving, hosted: tuple[str, ...]) -> Platform:
    platform = build_platform(
        options.config,
        applications=hosted,
        rate=options.rate,
        cold=options.cold,
        seed=options.seed,
        sample=options.sample,
        truth=options.truth,
        world=options.world,
        uses=Uses(options.stations, how.name, options.certificates, every=True),
    )
    for name in options.applications:
        if getattr(platform, name) is None:
            raise ConfigError(f"{platform.path}: describes no {name}, so it cannot be served")
    return platform


def _await_end(ended: "SimpleQueue[str]") -> None:
    while True:
        with suppress(Empty):
            logger.info("ended by %s", ended.get(timeout=LOOK_S))
            return
