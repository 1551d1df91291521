"""Lens and light of another station; their panels use these as well."""

from typing_extensions import override

from cosmic.frame.errors import ConfigError
from cosmic.frame.task import Task
from cosmic.vico.api.lens import LensHandle, LightHandle
from cosmic.vico.api.remote_application import RemoteVicoApplication
from cosmic.vico.core.peripheral_state import PeripheralState
from cosmic.vico.core.zoom_scale import ZoomScale
from cosmic.vico.hw.peripherals import LensAxis, LensState


class RemoteLensHandle(LensHandle):
    """The motorised lens of another station; moving it needs the lease there."""

    def __init__(self, remote: RemoteVicoApplication) -> None:
        self._remote = remote

    @property
    @override
    def name(self) -> str:
        state = self._remote.state
        return (state.lens_name if state is not None else "") or "Lens"

    @property
    @override
    def problem(self) -> str:
        known = _peripherals(self._remote)
        return known.lens_problem if known is not None else self._remote.problem

    @property
    @override
    def scale(self) -> ZoomScale:
        return self._remote.zoom_scale

    @override
    def state(self, axis: LensAxis) -> LensState | None:
        known = _peripherals(self._remote)
        return known.axis(axis) if known is not None else None

    @override
    def home(self) -> Task:
        return self._remote.calls.begin("Homing the lens", "home")

    @override
    def zoom_to(self, zoom: float) -> Task:
        self.scale.counts(zoom)  # says what the table holds
        return self._remote.calls.begin("Moving the zoom", "zoom_to", zoom=zoom)

    @override
    def seek_focus(self, target_counts: int) -> Task:
        title = "Moving the focus"
        return self._remote.calls.begin(title, "seek_focus", target_counts=target_counts)

    @override
    def autofocus(self, camera: str = "") -> Task:
        return self._remote.calls.begin("Autofocus", "autofocus", camera=camera)

    @override
    def abort(self) -> None:
        self._remote.calls.urgently("abort")

    @override
    def reopen(self) -> Task:
        return self._remote.calls.begin("Connecting lens and light", "reopen")


class RemoteLightHandle(LightHandle):
    """The lamp of another station."""

    def __init__(self, remote: RemoteVicoApplication) -> None:
        self._remote = remote

    @property
    @override
    def name(self) -> str:
        state = self._remote.state
        return (state.light_name if state is not None else "") or "Light"

    @property
    @override
    def problem(self) -> str:
        known = _peripherals(self._remote)
        return known.light_problem if known is not None else self._remote.problem

    @property
    @override
    def percent(self) -> float | None:
        known = _peripherals(self._remote)
        return known.light_percent if known is not None else None

    @override
    def set_percent(self, percent: float) -> Task:
        if not 0.0 <= percent <= 100.0:
            raise ConfigError(f"light: {percent!r} is not between 0 and 100 %")
        return self._remote.calls.begin("Setting the light", "set_percent", percent=percent)


def _peripherals(remote: RemoteVicoApplication) -> PeripheralState | None:
    state = remote.state
    return state.peripherals if state is not None else None
