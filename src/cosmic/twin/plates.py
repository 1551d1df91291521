"""What lies on one plate after the other, drawn from the seed."""

import math
import random

from cosmic.twin.force_settings import FibreSettings, StandardSettings
from cosmic.twin.sample_layout import put_on
from cosmic.twin.settings import TwinSettings
from cosmic.twin.world import World


class Plates:
    """Plates for one session.

    Parameters
    ----------
    settings : TwinSettings
        Constants of the session.
    sample : str or None
        What lies on each plate; None: the fibres that twin.toml lists.
    """

    def __init__(
        self, settings: TwinSettings, world: World, seed: int, sample: str | None = None
    ) -> None:
        self._settings = settings
        self._world = world
        self._seed = seed
        self._sample = sample
        self._standard = settings.standards.get(world.standard)

    def first(self) -> TwinSettings:
        """Return the constants with the first plate on the table.

        Raises
        ------
        ConfigError
            There is no such sample, its fibres find no room, or the world does not fit.
        """
        settings = self._settings
        if self._sample is not None:
            settings = put_on(settings, self._sample, self._seed, keep_clear=self._certified())
        fibres = self._of_world(settings.fibres, 0)
        return settings.model_copy(update={"fibres": fibres})

    def fibres(self, number: int) -> tuple[FibreSettings, ...]:
        """Return the fibres of a later plate, from 1 on; all of them lie on it.

        Raises
        ------
        ConfigError
            As `first` does.
        """
        settings = self._settings
        if self._sample is not None:
            settings = put_on(
                settings, self._sample, self._seed, number=number, keep_clear=self._certified()
            )
        lying = tuple(each for each in settings.fibres if not each.held_by)
        return self._of_world(lying, number)

    def _of_world(self, fibres: tuple[FibreSettings, ...], plate: int) -> tuple[FibreSettings, ...]:
        drawn = tuple(
            self._world.fibre_of(each, f"{number} {plate} {self._seed}")
            for number, each in enumerate(fibres)
        )
        return drawn + self._true_standard()

    def _certified(self) -> tuple[FibreSettings, ...]:
        return () if self._standard is None else (standard_fibre(self._standard, 0.0),)

    def _true_standard(self) -> tuple[FibreSettings, ...]:
        """Return the standard as it truly is: the same one on each plate of a session."""
        if self._standard is None:
            return ()
        chance = random.Random(f"standard {self._world.standard} {self._seed}")
        off = 0.5 * self._standard.expanded_percent / 100.0 * chance.gauss(0.0, 1.0)
        return (standard_fibre(self._standard, off),)


def standard_fibre(standard: StandardSettings, off: float) -> FibreSettings:
    """Return a glass fibre whose stiffness differs by a part from that of its certificate."""
    area_um2 = 0.25 * math.pi * standard.diameter_um**2
    return FibreSettings(
        length_um=standard.length_um,
        width_um=standard.diameter_um,
        thickness_um=standard.diameter_um,
        ei_n_m2=standard.ei_n_m2 * (1.0 + off),
        ea_n=standard.modulus_gpa * 1e9 * area_um2 * 1e-12,
        x_um=standard.x_um,
        y_um=standard.y_um,
        angle_deg=standard.angle_deg,
        role="standard",
    )
