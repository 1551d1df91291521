"""The lens, its autofocus and the light of ``rig.vico``; their panels use these as well."""

from typing_extensions import override

from cosmic.frame.arguments import checked_class
from cosmic.frame.clock import Clock
from cosmic.frame.declaration import Declared, command
from cosmic.frame.declaration import state as declared_state
from cosmic.frame.errors import ConfigError, NotAvailable
from cosmic.frame.operation import Task
from cosmic.vico.api.application import VicoApplication
from cosmic.vico.core.autofocus import Autofocus
from cosmic.vico.core.zoom_scale import ZoomPoint, ZoomScale
from cosmic.vico.hw.peripherals import LensAxis, LensState


@checked_class
class LensHandle(Declared):
    """The motorised lens; any thread, and everything returns at once."""

    def __init__(self, application: VicoApplication) -> None:
        self._application = application
        self._thread = application.peripherals

    @property
    @override
    def clock(self) -> Clock:
        """The platform's."""
        return self._application.clock

    @property
    @declared_state(unknown="Lens")
    def name(self) -> str:
        """What the operator reads."""
        return self._thread.lens_name or "Lens"

    @property
    def problem(self) -> str:
        """Why it cannot be used; empty when all is well."""
        return self.away or self._fault

    @property
    @declared_state
    def _fault(self) -> str:
        return self._thread.state.lens_problem

    @property
    def scale(self) -> ZoomScale:
        """Magnification and um per pixel for each position of the zoom."""
        return ZoomScale(self._points)

    @property
    @declared_state
    def _points(self) -> tuple[ZoomPoint, ...]:
        return self._application.zoom_scale.points

    @property
    def steps(self) -> tuple[ZoomPoint, ...]:
        """Zoom positions with a name, from the smallest."""
        return self.scale.steps

    @property
    def zoom_range(self) -> tuple[float, float]:
        """Least and most magnification; raises `ConfigError` where the table is empty."""
        return self.scale.zoom_range

    @property
    def zoom(self) -> float | None:
        """Magnification now; None while unknown."""
        state = self.state(LensAxis.ZOOM)
        known = state is not None and state.homed
        return self.scale.zoom(state.position_counts) if state is not None and known else None

    def state(self, axis: LensAxis) -> LensState | None:
        """Return what was last heard of a motor, "zoom" or "focus"; None before.

        Raises
        ------
        ConfigError
            The lens has no such motor.
        """
        try:
            motor = LensAxis(axis)
        except ValueError:
            raise ConfigError(
                f"the lens has no motor {axis!r}; its motors are {', '.join(LensAxis)}"
            ) from None
        found = self._motors.get(motor.name)
        return None if self.away else found

    @property
    @declared_state
    def _motors(self) -> dict[str, LensState | None]:
        known = self._thread.state
        return {each.name: known.axis(each) for each in LensAxis}

    @command(moves=True)
    def home(self) -> Task:
        """Begin to run both motors to where counting begins."""
        return self._thread.home()

    def zoom_to(self, zoom: float) -> Task:
        """Begin to zoom; the task fails where the lens has not been homed.

        Raises
        ------
        ConfigError
            The magnification is not in the table.
        """
        return self.seek_zoom(self.scale.counts(zoom))

    @command(moves=True)
    def seek_zoom(self, target_counts: int) -> Task:
        """Begin to zoom there; the task fails with what the controller refuses."""
        return self._thread.seek(LensAxis.ZOOM, target_counts)

    @command(moves=True)
    def seek_focus(self, target_counts: int) -> Task:
        """Begin to focus there; the task fails with what the controller refuses."""
        return self._thread.seek(LensAxis.FOCUS, target_counts)

    @command(moves=True)
    def autofocus(self, camera: str = "") -> Task:
        """Begin to look for the sharpest image of a camera behind the lens.

        A sweep finds it, and teaches how fast images blur at this zoom; from then on two images do,
        where they are sure. Frames exposed before a movement ended are not looked at. Where no
        focus is found, the lens goes back to where it was.

        Raises
        ------
        NotAvailable
            The camera is not behind the lens, or another long operation is under way.
        """
        application = self._application
        unit = application.unit(camera or application.first_camera)
        if not unit.config.behind_lens:
            raise NotAvailable(f"{unit.config.name} has a lens of its own; there is no motor")
        search = application.begin(
            f"Autofocus of {unit.config.name}",
            lambda task: Autofocus(
                task, unit, self._thread, application.clock, application.focus_models
            ).run(),
        )
        application.focus_search = search
        return search

    @command(at_once=True)
    def abort(self) -> None:
        """Stop both motors and whatever moves them."""
        self._application.stop_lens()

    @command
    def reopen(self) -> Task:
        """Begin to connect again what was lost."""
        return self._thread.reopen()


@checked_class
class LightHandle(Declared):
    """The lamp; any thread, and everything returns at once."""

    def __init__(self, application: VicoApplication) -> None:
        self._thread = application.peripherals

    @property
    @declared_state(unknown="Light")
    def name(self) -> str:
        """What the operator reads."""
        return self._thread.light_name or "Light"

    @property
    def problem(self) -> str:
        """Why it cannot be used; empty when all is well."""
        return self.away or self._fault

    @property
    @declared_state
    def _fault(self) -> str:
        return self._thread.state.light_problem

    @property
    def percent(self) -> float | None:
        """How bright it is, 0 to 100; None while unknown."""
        return None if self.away else self._percent

    @property
    @declared_state
    def _percent(self) -> float | None:
        return self._thread.state.light_percent

    def set_percent(self, percent: float) -> Task:
        """Begin to make it so bright; of several in a row the last counts.

        Raises
        ------
        ConfigError
            Outside 0 to 100.
        """
        if not 0.0 <= percent <= 100.0:
            raise ConfigError(f"light: {percent!r} is not between 0 and 100 %")
        return self.dim(percent)

    @command
    def dim(self, percent: float) -> Task:
        """Begin to make it so bright, without a look at the number first."""
        return self._thread.set_light(percent)
