"""What was found on this computer, and what to do about what is missing."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from enum import StrEnum

from cosmic.frame.errors import CosmicError


class State(StrEnum):
    """How a finding is judged."""

    GOOD = "good"
    NOTE = "note"
    """Worth knowing; the platform file needs nothing of it."""
    PROBLEM = "problem"


@dataclass(frozen=True, slots=True)
class Finding:
    """One line of the page.

    Attributes
    ----------
    area : str
        Heading that it stands under.
    name : str
        What was looked at.
    found : str
        What is there.
    advice : str
        What to do; empty when nothing is.
    """

    area: str
    name: str
    state: State
    found: str
    advice: str = ""


Check = Callable[[], Iterable[Finding]]


def missing(*, needed: bool) -> State:
    """Return how something missing is judged."""
    return State.PROBLEM if needed else State.NOTE


def carry_out(area: str, name: str, check: Check, *, needed: bool) -> list[Finding]:
    """Return what a check finds; what stops it is a finding as well."""
    try:
        return list(check())
    except CosmicError as exc:
        return [Finding(area, name, missing(needed=needed), "not available", str(exc))]
    except Exception as exc:  # noqa: BLE001 - a driver raises what it likes; the page is written
        found = f"failed: {type(exc).__name__}: {exc}"
        return [Finding(area, name, missing(needed=needed), found, "Repair or reinstall it.")]
