"""The scripted API: ``cosmic.connect()`` and the `Rig` it returns."""

import atexit
import logging
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Self

from typing_extensions import override

from cosmic.app.platform import Platform, build_platform
from cosmic.app.platform_file import KNOWN_APPLICATIONS
from cosmic.autonomy.control.control import Control
from cosmic.daqco.api.daqco import Daqco
from cosmic.frame.errors import ConfigError, NotAvailable, NotConnectedError
from cosmic.mico.api.mico import Mico
from cosmic.vico.api.vico import Vico

if TYPE_CHECKING:
    from cosmic.mico.hw.sim_scu3d_faults import Faults

logger = logging.getLogger(__name__)


class Rig:
    """The whole platform, as scripts and the console see it; any thread.

    As a context manager it closes at the end of the block: everything stops, the hold is
    released, all threads end.
    """

    def __init__(self, platform: Platform, source: str = "script") -> None:
        self._platform = platform
        self._mico = Mico(platform.mico, source) if platform.mico is not None else None
        self._daqco = Daqco(platform.daqco) if platform.daqco is not None else None
        self._vico = Vico(platform.vico) if platform.vico is not None else None
        self._control: Control | None = None
        if self._mico is not None:
            self._control = Control(
                self._mico,
                self._daqco,
                platform.file.control,
                platform.policy,
                rate=platform.clock.rate,
            )
        self._closed = False

    @override
    def __repr__(self) -> str:
        kind = "simulated" if self.simulated else "real hardware"
        return f"<Rig {self._platform.file.platform.name!r}, {kind}>"

    @property
    def simulated(self) -> bool:
        """True when no hardware moves."""
        return self._platform.simulated

    @property
    def mico(self) -> Mico:
        """Micromanipulation; raises `NotAvailable` where it is not hosted."""
        if self._mico is None:
            raise NotAvailable("mico is not hosted here; name it in the platform file")
        return self._mico

    @property
    def daqco(self) -> Daqco:
        """Data acquisition; raises `NotAvailable` where it is not hosted."""
        if self._daqco is None:
            raise NotAvailable("daqco is not hosted here; name it in the platform file")
        return self._daqco

    @property
    def vico(self) -> Vico:
        """Vision; raises `NotAvailable` where it is not hosted."""
        if self._vico is None:
            raise NotAvailable("vico is not hosted here; name it in the platform file")
        return self._vico

    @property
    def control(self) -> Control:
        """Control loops; raises `NotAvailable` where mico is not hosted."""
        if self._control is None:
            raise NotAvailable("mico is not hosted here; a control loop has nothing to move")
        return self._control

    @property
    def stopped(self) -> str | None:
        """Why motion is stopped, or None while it is allowed."""
        mico = self._platform.mico
        return mico.manager.latch.state.reason if mico is not None else None

    def stop(self, reason: str = "stop from a script") -> None:
        """Stop every axis now; nothing moves again before `reset_stop`. Returns at once."""
        if self._platform.mico is not None:
            self._platform.mico.manager.stop(reason)

    def reset_stop(self) -> None:
        """Allow motion again; what was stopped does not go on by itself."""
        if self._platform.mico is not None:
            self._platform.mico.manager.reset_stop()

    @property
    def faults(self) -> "Faults":
        """Trouble that can be injected into the simulated platform, by name.

        ``rig.faults.inject("unplugged", device=1)``; docs/explanation/simulated-controller.md
        lists the names.

        Raises
        ------
        NotAvailable
            The platform is real: it has troubles of its own.
        """
        if self._platform.faults is None:
            raise NotAvailable("faults can be injected into a simulated platform only")
        return self._platform.faults

    def close(self) -> None:
        """Stop everything, release the hold and end all threads; harmless the second time."""
        if not self._closed:
            self._closed = True
            atexit.unregister(self.close)
            if self._control is not None:
                self._control.close()
            self._platform.shut_down()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


def connect(
    config: str | Path | None = None,
    applications: Sequence[str] = KNOWN_APPLICATIONS,
    rate: float = 1.0,
    stations: Mapping[str, str] | None = None,
    *,
    cold: bool = False,
    seed: int = 0,
    sample: str | None = None,
) -> Rig:
    """Start the platform in this process and return it; no window and no event loop needed.

    Parameters
    ----------
    config : path or None
        A platform.toml or its folder; None is the simulated platform that ships with CoSMic.
    applications : sequence of str
        Which of "mico", "daqco", "vico" to host, as far as the platform file names them.
    rate : float
        How many times faster than the wall the simulated platform runs at most.
    stations : mapping
        Addresses of other stations.
    cold : bool
        Start the simulated platform at power-up, with no position known.
    seed : int
        Of everything random in the simulated platform.
    sample : str or None
        What lies on the simulated plate, as twin.toml names it, such as "forty-dry"; None: the
        fibres that twin.toml lists.

    Raises
    ------
    ConfigError
        The configuration is wrong; a line for every mistake with file, key and reason.
    NotConnectedError
        The vendor library is not there, or no device answers.
    NotAvailable
        `stations` was given: other stations are not built yet.
    """
    if stations:
        raise NotAvailable("other stations are not built yet; leave stations out")
    if isinstance(applications, str):
        applications = (applications,)
    unknown = [name for name in applications if name not in KNOWN_APPLICATIONS]
    if unknown:
        raise ConfigError(
            f"applications: unknown application {unknown[0]!r}; "
            f"known are {', '.join(KNOWN_APPLICATIONS)}"
        )
    platform = build_platform(
        config, applications=tuple(applications), rate=rate, cold=cold, seed=seed, sample=sample
    )
    rig = Rig(platform)
    atexit.register(rig.close)
    platform.initialize()
    if platform.mico is not None and platform.mico.failure:
        rig.close()
        raise NotConnectedError(platform.mico.failure)
    return rig
