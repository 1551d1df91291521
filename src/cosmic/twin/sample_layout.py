"""Lays the fibres of a sample on the plate, from its settings and a seed."""

import math
from typing import Final

import numpy as np

from cosmic.frame.arrays import Floats
from cosmic.frame.errors import ConfigError
from cosmic.twin.force_settings import FibreSettings, Role
from cosmic.twin.optics.shapes import lying
from cosmic.twin.sample_settings import SampleSettings
from cosmic.twin.settings import TwinSettings

TRIES: Final = 4000
"""Positions tried for one fibre before the plate is called full."""

NODE_UM: Final = 30.0
"""Fibres are kept apart by points so far apart along them."""


def put_on(
    settings: TwinSettings,
    name: str,
    seed: int,
    *,
    number: int = 0,
    keep_clear: tuple[FibreSettings, ...] = (),
) -> TwinSettings:
    """Return `settings` with the sample `name` on the plate, and grippers open and empty.

    Parameters
    ----------
    number : int
        Which plate with this sample it is.
    keep_clear : tuple of FibreSettings
        What lies there already.

    Raises
    ------
    ConfigError
        There is no such sample, or its fibres find no room.
    """
    sample = settings.samples.get(name)
    if sample is None:
        known = ", ".join(settings.samples) or "none"
        raise ConfigError(f"sample: there is no sample {name!r} in twin.toml; known: {known}")
    stages = dict(settings.stages)
    for gripper in settings.geometry.grippers.values():
        position = stages[gripper.stage]
        stages[gripper.stage] = position.model_copy(update={"start": sample.gap_um})
    fibres = Spread(name, sample, seed, number, keep_clear).fibres()
    handling = settings.handling.model_copy(update={"default_faults": sample.faults})
    return settings.model_copy(update={"fibres": fibres, "stages": stages, "handling": handling})


class Spread:
    """Draws fibres and finds them room; made for one sample and seed.

    Parameters
    ----------
    name : str
        Of the sample, for messages.
    """

    def __init__(
        self,
        name: str,
        sample: SampleSettings,
        seed: int,
        number: int = 0,
        keep_clear: tuple[FibreSettings, ...] = (),
    ) -> None:
        self._name = name
        self._sample = sample
        key = [0x5A, sample.seed, seed, number] if number else [0x5A, sample.seed, seed]
        self._rng = np.random.default_rng(key)
        lines = [dense(centre_line_um(each)) for each in keep_clear]
        self._points = np.concatenate([np.empty((0, 2)), *lines])
        self._halves = np.concatenate(
            [
                np.empty(0),
                *(
                    np.full(len(line), 0.5 * each.width_um)
                    for line, each in zip(lines, keep_clear, strict=True)
                ),
            ]
        )

    def fibres(self) -> tuple[FibreSettings, ...]:
        """Return all of them; partners of a pair follow one another.

        Raises
        ------
        ConfigError
            They find no room.
        """
        sample = self._sample
        found: list[FibreSettings] = []
        # Pairs first: they need the most room.
        for _ in range(sample.crossing):
            found += self._located(self._pair("crossing", len(found)))
        for _ in range(sample.stuck):
            found += self._located(self._pair("stuck", len(found)))
        for _ in range(sample.single):
            found += self._located([self._drawn("single")])
        for _ in range(sample.debris):
            found += self._located([self._piece()])
        return tuple(found)

    # ------------------------------------------------------------------ drawing

    def _drawn(self, role: Role) -> FibreSettings:
        sample = self._sample
        width = self._lognormal(sample.width_um, sample.width_sigma_ln, 15.0, 60.0)
        kinked = self._rng.random() < sample.kinked
        curl = float(np.clip(self._rng.normal(0.0, sample.curl_deg), -120.0, 120.0))
        kink = float(np.clip(self._rng.normal(0.0, sample.kink_deg), -80.0, 80.0))
        return FibreSettings(
            length_um=self._lognormal(
                sample.length_um,
                sample.length_sigma_ln,
                sample.length_low_um,
                sample.length_high_um,
            ),
            width_um=width,
            thickness_um=2.0 * sample.wall_um,
            ei_n_m2=self._lognormal(
                sample.ei_n_m2, sample.ei_sigma_ln, sample.ei_low_n_m2, math.inf
            ),
            ea_n=sample.elastic_gpa * 1e9 * width * 1e-6 * 2.0 * sample.wall_um * 1e-6,
            curl_deg=curl,
            kink_deg=kink if kinked else 0.0,
            role=role,
        )

    def _piece(self) -> FibreSettings:
        whole = self._drawn("debris")
        length = self._lognormal(self._sample.debris_um, 0.4, 40.0, 300.0)
        return whole.model_copy(update={"length_um": length, "curl_deg": 0.0, "kink_deg": 0.0})

    def _pair(self, role: Role, number: int) -> list[FibreSettings]:
        """Return two fibres that touch, the first through the origin along x."""
        sample, rng = self._sample, self._rng
        first = self._drawn(role)
        second = self._drawn(role)
        if role == "crossing":
            x, y = rng.uniform(-0.3, 0.3) * first.length_um, 0.0
            angle = float(rng.choice([-1.0, 1.0]) * rng.uniform(35.0, 90.0))
            pull = sample.crossing_un
        else:
            x = rng.uniform(-0.4, 0.4) * first.length_um
            y = float(rng.choice([-0.4, 0.4])) * (first.width_um + second.width_um)
            angle = float(rng.uniform(-6.0, 6.0))
            pull = sample.stuck_un
        along = rng.uniform(-0.3, 0.3) * second.length_um if role == "crossing" else 0.0
        turn = math.radians(angle)
        lies = {
            "x_um": float(x - along * math.cos(turn)),
            "y_um": float(y - along * math.sin(turn)),
            "angle_deg": angle,
            "bonded_to": number,
            "bond_un": self._lognormal(pull, 0.5, 0.0, math.inf),
        }
        return [first, second.model_copy(update=lies)]

    def _lognormal(self, median: float, sigma_ln: float, low: float, high: float) -> float:
        for _ in range(TRIES):
            value = float(median * math.exp(sigma_ln * self._rng.standard_normal()))
            if low <= value <= high:
                return value
        raise ConfigError(
            f"samples.{self._name}: hardly any value around {median:g} lies between {low:g} and "
            f"{high:g}; widen the bounds"
        )

    # ------------------------------------------------------------------ finding room

    def _located(self, group: list[FibreSettings]) -> list[FibreSettings]:
        """Return a group somewhere on the plate where it touches nothing else."""
        lines = [dense(centre_line_um(each)) for each in group]
        halves = np.concatenate(
            [
                np.full(len(line), 0.5 * each.width_um)
                for line, each in zip(lines, group, strict=True)
            ]
        )
        points = np.concatenate(lines)
        for _ in range(TRIES):
            angle = self._rng.uniform(-math.pi, math.pi)
            radius = self._sample.radius_um * math.sqrt(self._rng.random())
            where = self._rng.uniform(-math.pi, math.pi)
            x, y = radius * math.cos(where), radius * math.sin(where)
            cos, sin = math.cos(angle), math.sin(angle)
            there = points @ np.array([[cos, sin], [-sin, cos]]) + (x, y)
            if self._free(there, halves):
                self._points = np.concatenate([self._points, there])
                self._halves = np.concatenate([self._halves, halves])
                return [_moved(each, x, y, angle) for each in group]
        raise ConfigError(
            f"samples.{self._name}: no room for all fibres within radius_um at distance_um from "
            "each other; put fewer of them"
        )

    def _free(self, points: Floats, halves: Floats) -> bool:
        if (np.hypot(points[:, 0], points[:, 1]) > self._sample.radius_um).any():
            return False
        # Most positions are bad, and a few points show it.
        return self._clear(points[::8], halves[::8]) and self._clear(points, halves)

    def _clear(self, points: Floats, halves: Floats) -> bool:
        apart = points[:, None, :] - self._points[None, :, :]
        needed = self._sample.distance_um + halves[:, None] + self._halves[None, :]
        return bool((np.einsum("abc,abc->ab", apart, apart) >= needed * needed).all())


def _moved(fibre: FibreSettings, x: float, y: float, angle: float) -> FibreSettings:
    cos, sin = math.cos(angle), math.sin(angle)
    return fibre.model_copy(
        update={
            "x_um": round(x + cos * fibre.x_um - sin * fibre.y_um, 3),
            "y_um": round(y + sin * fibre.x_um + cos * fibre.y_um, 3),
            "angle_deg": round(math.degrees(angle) + fibre.angle_deg, 4),
        }
    )


def centre_line_um(fibre: FibreSettings) -> Floats:
    """Return the centre line of a lying fibre on the plate, shape (n, 2)."""
    line = lying(fibre.length_um, fibre.curl_deg, fibre.kink_deg)
    angle = math.radians(fibre.angle_deg)
    cos, sin = math.cos(angle), math.sin(angle)
    return np.asarray(line @ np.array([[cos, sin], [-sin, cos]]) + (fibre.x_um, fibre.y_um))


def dense(line: Floats) -> Floats:
    """Return points at most `NODE_UM` apart along a line."""
    steps = np.hypot(*np.diff(line, axis=0).T)
    along = np.concatenate([[0.0], np.cumsum(steps)])
    positions = np.linspace(0.0, along[-1], max(int(along[-1] / NODE_UM) + 2, 2))
    return np.column_stack([np.interp(positions, along, line[:, axis]) for axis in (0, 1)])
