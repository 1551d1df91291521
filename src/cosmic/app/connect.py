"""``cosmic.connect()``: the platform in the process of a script."""

import atexit
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path

from cosmic.app.audit import PlatformAudit, audit_file
from cosmic.app.configuration.platform_file import KNOWN_APPLICATIONS, check_applications
from cosmic.app.platform import Uses, build_platform
from cosmic.app.rig import Rig
from cosmic.app.stations.address import StationAddress
from cosmic.frame.arguments import check_path, checked
from cosmic.frame.errors import NotConnectedError


@checked
def connect(
    config: str | Path | None = None,
    applications: Sequence[str] = KNOWN_APPLICATIONS,
    rate: float = 1.0,
    stations: Mapping[str, str] | Sequence[str] | None = None,
    *,
    cold: bool = False,
    seed: int = 0,
    sample: str | None = None,
    truth: str | Path | None = None,
    world: str | None = None,
    certificates: str | Path | None = None,
) -> Rig:
    """Start the platform in this process and return it; no window and no event loop needed.

    What is commanded is written to this computer's audit trail, which `cosmic audit` lists.

    Parameters
    ----------
    config : path or None
        A platform.toml or its folder; None is the simulated platform that ships with CoSMic.
    applications : sequence of str
        Which of "mico", "daqco", "vico" to host, as far as the platform file names them.
    rate : float
        How many times faster than the wall the simulated platform runs at most.
    stations : mapping of str to str, or sequence of str
        Other stations by name, with where they listen, such as
        ``{"fibervision": "tcp/127.0.0.1:7448"}`` or ``"fibervision=tcp/127.0.0.1:7448"``; names
        alone of stations used before. What they host is used there and not hosted here.
    cold : bool
        Start the simulated platform at power-up, with no position known.
    seed : int
        Of everything random in the simulated platform.
    certificates : path or None
        Folder with the certificates of this program, for stations at ``tls/``; None: the one
        that the platform file names.
    sample : str or None
        What lies on the simulated plate, as twin.toml names it, such as "forty-dry"; None: the
        fibres that twin.toml lists.
    world : str or None
        How far the simulated platform is from what twin.toml says: "plain", "friendly",
        "realistic", "harsh", or a file in the folder `worlds`; None: the one that twin.toml names.
    truth : path or None
        A new file for what truly happens on the simulated platform, for whoever scores a run; see
        `cosmic.twin.truth.read_truth`.

    Raises
    ------
    ConfigError
        The configuration is wrong; a line for every mistake with file, key and reason.
    NotConnectedError
        The vendor library is not there, or no device answers.
    StationAway
        A station does not answer.
    NotAvailable
        What stations need is not installed.
    """
    for name, path in (("config", config), ("truth", truth), ("certificates", certificates)):
        if path is not None:
            check_path(name, path)
    if isinstance(applications, str):
        applications = (applications,)
    check_applications(applications, "applications")
    uses = Uses(
        _addresses(stations or ()),
        certificates=None if certificates is None else Path(certificates),
    )
    platform = build_platform(
        config,
        applications=tuple(applications),
        rate=rate,
        cold=cold,
        seed=seed,
        sample=sample,
        truth=truth,
        world=world,
        uses=uses,
    )
    at_end = ExitStack()
    at_end.enter_context(PlatformAudit(platform, audit_file()))
    rig = Rig(platform, at_end=at_end)
    atexit.register(rig.close)
    platform.initialize()
    if platform.failure:
        rig.close()
        raise NotConnectedError(platform.failure)
    return rig


def _addresses(stations: Mapping[str, str] | Sequence[str]) -> tuple[StationAddress, ...]:
    if not isinstance(stations, Mapping):
        names = (stations,) if isinstance(stations, str) else stations
        return tuple(StationAddress.read(each) for each in names)
    for station, endpoint in stations.items():
        if not (isinstance(station, str) and isinstance(endpoint, str)):
            raise TypeError(f"connect: stations must map names to endpoints, not {endpoint!r}")
    return tuple(StationAddress(*each) for each in stations.items())
