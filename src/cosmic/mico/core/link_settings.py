"""What platform.toml says about axes that are linked to each other."""

from collections.abc import Iterable, Mapping
from typing import Final, Self

from pydantic import model_validator

from cosmic.frame.config import StrictModel, not_there

RATIO: Final = (0.001, 1000.0)
"""Smallest and largest amount of a ratio."""


class LinkSettings(StrictModel):
    """A link that is there from the start."""

    first: str
    second: str
    ratio: float = 1.0

    @model_validator(mode="after")
    def _sensible(self) -> Self:
        text = mistake(self.first, self.second, self.ratio)
        if text:
            raise ValueError(text)
        return self


def mistake(first: str, second: str, ratio: float) -> str:
    """Return what is wrong with a link; empty when nothing is."""
    low, high = RATIO
    if first == second:
        return f"{first} cannot be linked with itself"
    if not low <= abs(ratio) <= high:
        return f"{first} and {second}: the ratio {ratio:g} is not within {low:g} to {high:g}"
    return ""


def link_misfits(links: Iterable[LinkSettings], kinds: Mapping[str, str]) -> list[str]:
    """Return what is wrong with the names in `links`, a line each.

    Parameters
    ----------
    kinds : mapping of str
        "linear", "rotary" or "open-loop" of every positioner, by name.
    """
    wrong: list[str] = []
    joined: dict[str, set[str]] = {}
    for number, link in enumerate(links):
        where = f"link[{number}]"
        for name in (link.first, link.second):
            if name not in kinds:
                wrong.append(f"{where}: {not_there('positioner', name, kinds)}")
            elif kinds[name] == "open-loop":
                wrong.append(f"{where}: {name} has no sensor: it cannot be linked")
        if kinds.get(link.first, "") != kinds.get(link.second, ""):
            wrong.append(f"{where}: {link.first} and {link.second} are not of one kind")
        one, other = (joined.get(name, {name}) for name in (link.first, link.second))
        if link.second in one:
            wrong.append(f"{where}: {link.first} and {link.second} are linked already")
        joined.update(dict.fromkeys(one | other, one | other))
    return wrong
