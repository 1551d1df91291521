"""Ways in: what a hostile program does through each of them, drawn at random."""

import random
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Final

from cosmic.app.rig import Rig
from cosmic.daqco.core.scale import Scale
from cosmic.frame.errors import CosmicError
from cosmic.mico.api.axis import Axis
from cosmic.mico.core.motion.messages import Order
from cosmic.mico.core.motion.orders import Calibrate, MoveBy, MoveTo, Reference, Reservation, Step

NONSENSE: Final[Sequence[Any]] = (
    None, "abc", "5 kg", b"5", float("nan"), float("inf"), -float("inf"), 1e308, 2**70, -1, 0,
    True, [], {}, (), object(), "1e6 um", "-9 mm", 10**400, "\0", "µ" * 5000,
)  # fmt: skip
SWEPT: Final = ("probe.y", "table.rotation")
"""The only axes that are calibrated, referenced and driven to their end stops."""
SWEEPS: Final = (Calibrate(), Reference())
"""What leads over the whole travel, beyond the soft limits too."""


class Attack:
    """Hostile calls through one way in; one thread.

    Attributes
    ----------
    calls, refused : int
        How many commands were given, and how many of them ended in a `CosmicError`.
    raw : list of str
        Errors that are neither that nor a `TypeError`.
    """

    def __init__(self, name: str, seed: int, pause_s: float = 0.001) -> None:
        self.name = name
        self.pause_s = pause_s
        self.chance = random.Random(f"{name} {seed}")
        self.calls = self.refused = 0
        self.raw: list[str] = []
        self.acts: list[tuple[float, Callable[[], object]]] = []

    def act(self) -> None:
        """Do one thing."""
        weights = [weight for weight, _ in self.acts]
        (act,) = self.chance.choices([act for _, act in self.acts], weights)
        self.calls += 1
        try:
            act()
        except (CosmicError, TypeError):
            self.refused += 1
        except Exception as exc:  # noqa: BLE001 - that is what is looked for
            if len(self.raw) < 50:
                self.raw.append(f"{self.name}, {getattr(act, '__name__', act)}: {exc!r}")


class StopSwitch:
    """Stops and resets, and tells the watch in the same breath; any thread."""

    def __init__(self, rig: Rig, watch: Any, now_s: Callable[[], float], coast_s: float) -> None:
        self._rig, self._watch, self._now_s = rig, watch, now_s
        self._coast_s = coast_s
        self._lock = threading.Lock()

    def stop(self) -> None:
        """Stop all; from `coast_s` on everything has to stand."""
        with self._lock:
            self._rig.stop("the adversary")
            self._watch.must_stand(self._now_s() + self._coast_s)

    def reset(self) -> None:
        """Let everything move again."""
        with self._lock:
            self._watch.may_move()
            self._rig.reset_stop()


class AxisAttack(Attack):
    """One axis at a time, as a script, the console or a station's client does."""

    def __init__(
        self, rig: Rig, seed: int, name: str = "axes", switch: StopSwitch | None = None
    ) -> None:
        super().__init__(name, seed)
        self._rig = rig
        self._axes = list(rig.mico)
        self._jogs: list[Any] = []
        self.acts = [
            (15, self._move_to), (15, self._move_by), (15, self._rush), (25, self._edge),
            (6, self._steps),
            (8, self._jog), (8, self._renew), (4, self._halt), (3, self._speed), (1, self._zero),
            (5, self._nonsense), (3, self._check), (4, self._group), (4, self._group_by),
            (1, self._link), (1, self._unlink), (1, self._undo),
        ]  # fmt: skip
        if switch is not None:
            self.acts += [(0.3, self._sweep), (2, switch.reset)]

    def _axis(self) -> Axis:
        return self.chance.choice(self._axes)

    def _target(self, axis: Axis) -> float:
        low, high = axis.limits or (-1000.0, 1000.0)
        span = high - low
        return self.chance.uniform(low - 0.1 * span, high + 0.1 * span)

    def _move_to(self) -> None:
        axis = self._axis()
        axis.move_to(self._target(axis), wait=False, consent=self.chance.random() < 0.1)

    def _move_by(self) -> None:
        size = 10 ** self.chance.uniform(-2, 4) * self.chance.choice((-1, 1))
        self._axis().move_by(size, wait=False)

    def _rush(self) -> None:
        """Bring the tools together: down, in, and the probe at them."""
        place = {
            "left.z": -400.0, "right.z": -400.0, "left.x": 3000.0, "right.x": -3000.0,
            "left.y": 0.0, "right.y": 0.0, "probe.y": -4500.0, "probe.x": 0.0,
        }  # fmt: skip
        name = self.chance.choice(sorted(place))
        self._rig.mico[name].move_to(place[name] + self.chance.gauss(0.0, 400.0), wait=False)

    def _edge(self) -> None:
        """Go as far in one direction as the gate lets it, and try a little further."""
        axis = self._axis()
        here, limits = axis.details.shown_position, axis.limits
        if here is None or limits is None:
            return
        near, far = here, self.chance.choice(limits)
        for _ in range(10):
            middle = (near + far) / 2.0
            near, far = (middle, far) if axis.check(middle).allowed else (near, middle)
        axis.move_to(near, wait=False)
        axis.move_by((far - near) * self.chance.uniform(0.5, 3.0), wait=False)

    def _steps(self) -> None:
        self._axis().steps(
            self.chance.randint(-30_500, 30_500) // 10 ** self.chance.randint(0, 4),
            amplitude_v=self.chance.choice((100.0, 50.0, 15.0, 101.0)),
            frequency_hz=self.chance.choice((100, 5000, 18500)),
            wait=False,
        )

    def _jog(self) -> None:
        speed = self.chance.choice((None, 5.0, 500.0, 5000.0))
        self._jogs = [
            *self._jogs[-3:],
            self._axis().jog(self.chance.choice((-1, 1)), speed),
        ]

    def _renew(self) -> None:
        for jog in self._jogs:
            jog.renew()

    def _halt(self) -> None:
        self._axis().halt()

    def _speed(self) -> None:
        self._axis().set_closed_loop_frequency(self.chance.choice((1, 500, 18500, 0, 20_000)))

    def _zero(self) -> None:
        axis = self._axis()
        self.chance.choice((axis.set_zero, axis.clear_zero))()

    def _check(self) -> None:
        axis = self._axis()
        axis.check(self._target(axis))

    def _sweep(self) -> None:
        axis = self._rig.mico[self.chance.choice(SWEPT)]
        self.chance.choice((axis.calibrate, axis.reference))(wait=False)

    def _several(self, value: Callable[[Axis], float]) -> dict[str, float]:
        chosen = self.chance.sample(self._axes, self.chance.randint(1, 6))
        return {axis.key: value(axis) for axis in chosen}

    def _group(self) -> None:
        self._rig.mico.move(
            self._several(self._target), wait=False, match_arrival=self.chance.random() < 0.3
        )

    def _group_by(self) -> None:
        self._rig.mico.move_by(self._several(lambda _: self.chance.gauss(0.0, 800.0)), wait=False)

    def _link(self) -> None:
        one, other = self.chance.sample(self._axes, 2)
        names = (one.key, other.key)
        self._rig.mico.link(*names, self.chance.choice((1.0, -1.0, 2.0, "abc", 0.0)))

    def _unlink(self) -> None:
        self._rig.mico.unlink(self._axis().key)

    def _undo(self) -> None:
        self._rig.mico.undo(wait=False)

    def _nonsense(self) -> None:
        axis, value = self._axis(), self.chance.choice(NONSENSE)
        act: Callable[[Any], object] = self.chance.choice(
            (
                lambda it: axis.move_to(it, wait=False),
                lambda it: axis.move_by(it, wait=False),
                lambda it: axis.steps(it, wait=False),
                lambda it: axis.jog(it, it),
                axis.set_closed_loop_frequency,
                lambda it: self._rig.mico.move({"left.x": it}, wait=False),
                lambda it: self._rig.mico.move(it, wait=False),
                self._rig.mico.check,
            )
        )
        act(value)


class OrderAttack(Attack):
    """Orders put together by hand, with reservations stolen, made up, or meant for others."""

    def __init__(self, rig: Rig, seed: int) -> None:
        super().__init__("orders", seed, 0.01)
        self._rig = rig
        self._axes = list(rig.mico)
        self._seen: list[Order] = []
        places = [rig.mico[name].details.address for name in SWEPT]
        self._swept = {(place.device, place.channel) for place in places}
        for axis in self._axes:
            device = rig.mico.application.manager.device(axis.key)
            device.submit = self._remembering(device.submit)
        self.acts = [(1, self._replay), (2, self._forge), (1, self._steal)]

    def _remembering(self, submit: Callable[[Order], None]) -> Callable[[Order], None]:
        def remembered(order: Order) -> None:
            self._seen = [*self._seen[-200:], order]
            submit(order)

        return remembered

    def _submit(self, order: Order) -> None:
        axis = self.chance.choice(self._axes)
        device = axis.details.address.device
        rightful = order.reservation is None
        if rightful and order.motion in SWEEPS and (device, order.channel) not in self._swept:
            # With the holder's token this is no attack, but a run over the whole travel, which
            # the gate allows where it is clear, and which leads beyond the soft limits.
            order = order._replace(token="mine")
        self._rig.mico.application.manager.device(axis.key).submit(order)

    def _epoch(self) -> int:
        mico = self._rig.mico.application
        return int(mico.manager.latch.state.epoch)

    def _replay(self) -> None:
        if self._seen:
            self._submit(self.chance.choice(self._seen))

    def _forge(self) -> None:
        motion = self.chance.choice(
            (
                MoveTo(self.chance.uniform(-7000.0, 7000.0), "um"),  # type: ignore[arg-type]
                MoveBy(self.chance.uniform(-7000.0, 7000.0), "um"),  # type: ignore[arg-type]
                Step(self.chance.choice((-29999, 29999)), 100.0, 18500),
                *SWEEPS,
            )
        )
        names = self._rig.mico.names
        reservation: Any = None
        if self.chance.random() < 0.7:
            try:
                reservation = Reservation(
                    self.chance.choice(names), self.chance.randint(1, 5000), self._epoch(), None
                )
            except TypeError:
                reservation = object()
        token = self._seen[-1].token if self._seen and self.chance.random() < 0.5 else "mine"
        self._submit(
            Order(self.chance.randint(0, 3), motion, token, "forged", reservation=reservation)
        )

    def _steal(self) -> None:
        reserved = [order for order in self._seen if order.reservation is not None]
        if reserved:
            order = self.chance.choice(reserved)
            motion = MoveTo(self.chance.uniform(-7000.0, 7000.0), "um")  # type: ignore[arg-type]
            self._submit(order._replace(motion=motion))


class ForceAttack(Attack):
    """Limits, scales, rates, recordings and control loops."""

    def __init__(self, rig: Rig, seed: int, folder: Path) -> None:
        super().__init__("force", seed, 0.02)
        self._rig = rig
        self._folder = folder
        self.acts = [
            (4, self._arm), (2, self._scale), (0.2, self._rate), (1, self._record),
            (1, self._end_record),
            (3, self._loop), (1, self._end_loops), (2, self._nonsense), (1, self._latest),
        ]  # fmt: skip

    def _arm(self) -> None:
        self._rig.daqco.arm_limit(
            "force", high=self.chance.choice((5.0, 150.0, 150.0, 150.0, 1e9, -1e9))
        )

    def _scale(self) -> None:
        unit = self.chance.choice(("uN", "mN"))
        self._rig.daqco.set_scale("force", Scale("hostile", unit, (0.0, self.chance.random())))

    def _rate(self) -> None:
        self._rig.daqco.configure(rate_hz=self.chance.choice((10.0, 1000.0, 2000.0, 20_000.0)))

    def _record(self) -> None:
        self._rig.daqco.start_recording(self._folder / "hostile.h5", overwrite=True)

    def _end_record(self) -> None:
        self._rig.daqco.stop_recording()

    def _loop(self) -> None:
        self._rig.control.hold_force(
            "force",
            self.chance.choice(("probe.x", "probe.y", "left.x", "nobody")),
            self.chance.choice((10.0, 120.0, -5.0, 1e6)),
            direction=self.chance.choice((1, -1)),
        )

    def _end_loops(self) -> None:
        self._rig.control.stop()

    def _latest(self) -> None:
        self._rig.daqco.latest()

    def _nonsense(self) -> None:
        value = self.chance.choice(NONSENSE)
        daqco, control = self._rig.daqco, self._rig.control
        act: Callable[[Any], object] = self.chance.choice(
            (
                lambda it: daqco.arm_limit("force", high=it),
                lambda it: daqco.configure(rate_hz=it),
                lambda it: daqco.set_scale("force", it),
                lambda it: control.hold_force("force", "probe.x", it, direction=1),
                lambda it: control.hold_force(it, it, 5.0, direction=it),
                daqco.mark,
            )
        )
        act(value)


class StopAttack(Attack):
    """Stops everything, looks whether it stands, and resets; from a thread of its own."""

    def __init__(self, switch: StopSwitch, seed: int) -> None:
        super().__init__("stop", seed)
        self._switch = switch
        self._wait = threading.Event()
        self.acts = [(1, self._stop)]

    def _stop(self) -> None:
        self._wait.wait(self.chance.expovariate(0.7))
        self._switch.stop()
        self._wait.wait(self.chance.uniform(0.02, 0.2))
        self._switch.reset()


class TrajectoryAttack(Attack):
    """Trajectories that begin anywhere and lead anywhere."""

    def __init__(self, rig: Rig, seed: int) -> None:
        super().__init__("trajectories", seed)
        self._rig = rig
        self.acts = [(1, self._run), (1, self._detour)]

    def _run(self) -> None:
        lines = ["cosmic-trajectory 1", "platform FiberStation"]
        for _ in range(self.chance.randint(1, 8)):
            axis = self.chance.choice(("left.x", "left.z", "right.x", "right.z", "probe.x"))
            lines.append(f"{axis} to {self.chance.uniform(-5000.0, 5000.0):.1f} um")
        mico = self._rig.mico
        found = mico.trajectories.parse("\n".join(lines) + "\n")
        player = mico.trajectories.run(found, start="straight", wait=False)
        player.wait(self.chance.uniform(0.1, 3.0))

    def _detour(self) -> None:
        names = ("left.x", "left.y", "left.z")
        target = {name: self.chance.uniform(-5000.0, 5000.0) for name in names}
        self._rig.mico.move_around(target, budget_s=0.2, wait=False)
