"""What a bend test measured, before anything is fitted to it."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cosmic.autonomy.bending.bent_shape import BentShape
from cosmic.autonomy.bending.curved import NaturalShape
from cosmic.frame.arrays import Floats
from cosmic.frame.renamed import renamed_fields


@renamed_fields(way_um="probe_um")
@dataclass(frozen=True, slots=True, eq=False)
class Freed:
    """The force after the fibre was slid up and down the probe, and back to where it was.

    Friction that holds a section askew, and makes it too stiff, is turned round by that: as much
    of it is left after a slide up as is left, the other way, after one down.

    Attributes
    ----------
    after : int
        Number of the point of the span that was read just before, at the same place.
    up_un, down_un : ndarray, shape (n,), float64
        Mean force after each slide up, and after each down.
    std_un : float
        Standard deviation of each.
    wait_s : float
        From the point before until half of these were read.
    """

    after: int
    up_un: Floats
    down_un: Floats
    std_un: float
    wait_s: float


@dataclass(frozen=True, slots=True, eq=False)
class Span:
    """One push of the probe against a held fibre, out and back, at one position along it.

    Attributes
    ----------
    nominal_um : float
        From the tip of the jaws to the middle of the probe, as well as it is known.
    probe_x_um, hold_x_um : float
        Positions of the axes along the fibre as their encoders read them. Differences between the
        spans of one grasp are exact; the sum with `nominal_um` holds an offset common to all.
    probe_um : ndarray, shape (n,), float64
        Position of the probe's axis across the fibre, growing as it pushes.
    force_un : ndarray, shape (n,), float64
        Mean force at each, positive when the fibre pushes back, with the baseline still in it.
    force_std_un : ndarray, shape (n,), float64
        Standard deviation of that mean.
    time_s : ndarray, shape (n,), float64
        On the platform's clock.
    loading : ndarray, shape (n,), bool
        True on the way out, False on the way back.
    shape : NaturalShape or None
        Of the fibre before the push, where it is not straight; `nominal_um` is then the lever of
        a straight fibre that gives way as much.
    freed : Freed or None
        What was read on the way out once friction was made to let go; None: it was not.
    bent : BentShape or None
        What an image shows at the farthest point; None: none was taken.
    """

    nominal_um: float
    probe_x_um: float
    hold_x_um: float
    probe_um: Floats
    force_un: Floats
    force_std_un: Floats
    time_s: Floats
    loading: npt.NDArray[np.bool_]
    shape: NaturalShape | None = None
    freed: Freed | None = None
    bent: BentShape | None = None
