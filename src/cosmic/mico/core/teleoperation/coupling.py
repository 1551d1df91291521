"""What joins steering with a measured force, without knowing who measures it."""

from collections.abc import Callable
from dataclasses import dataclass

from cosmic.mico.core.teleoperation.mapping import Converter, ProfileMapping


@dataclass(frozen=True)
class ForceCoupling:
    """What another subsystem has to say about steering; any thread.

    Attributes
    ----------
    make_converter : callable
        Puts something between the inputs and the movements.
    begin, end : callable
        Called when teleoperation begins and ends.
    slowed : callable
        Part of the speed that the force leaves now.
    problem : callable
        Returns why nobody could steer with it now; empty when all is well.
    """

    make_converter: Callable[[ProfileMapping], Converter]
    begin: Callable[[], None]
    end: Callable[[], None]
    slowed: Callable[[], float]
    problem: Callable[[], str] = lambda: ""
