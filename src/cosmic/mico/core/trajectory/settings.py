"""What platform.toml says about trajectories."""

from collections import Counter
from collections.abc import Collection
from typing import Annotated, Self

from pydantic import Field, model_validator

from cosmic.frame.config import StrictModel, not_there

Pair = Annotated[tuple[str, str], Field(strict=False)]


class MirrorSettings(StrictModel):
    """Which axes correspond to each other in the two assemblies that face each other.

    An axis without counterpart, such as a table between them, is paired with itself.
    """

    pairs: Annotated[tuple[Pair, ...], Field(strict=False)] = ()
    reversed: Annotated[tuple[str, ...], Field(strict=False)] = ()

    def partners(self) -> dict[str, str]:
        """Return the counterpart of each axis."""
        return dict(self.pairs) | {second: first for first, second in self.pairs}

    def misfits(self, names: Collection[str]) -> list[str]:
        """Return a line for each axis that is none of the positioners of those names."""
        return [
            f"mirror.pairs[{index}]: {not_there('positioner', name, names)}"
            for index, pair in enumerate(self.pairs)
            for name in dict.fromkeys(pair)
            if name not in names
        ]

    @model_validator(mode="after")
    def _once_each(self) -> Self:
        counts = Counter(name for pair in self.pairs for name in set(pair))
        twice = [name for name, count in counts.items() if count > 1]
        if twice:
            raise ValueError(f"{twice[0]} is in two pairs")
        partners = self.partners()
        for name in self.reversed:
            if name not in partners:
                raise ValueError(f"reversed: {name} is in no pair")
            if partners[name] not in self.reversed:
                raise ValueError(f"reversed: name {partners[name]} too, which mirrors {name}")
        return self
