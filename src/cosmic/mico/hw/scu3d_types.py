"""What SmarAct's positioner type codes mean to CoSMic."""

from typing import Final

from cosmic.mico.hw.interface import PositionerKind, PositionerType, ReferenceKind

_LINEAR, _ROTARY = PositionerKind.LINEAR, PositionerKind.ROTARY
_NONE, _END, _MARK = ReferenceKind.NONE, ReferenceKind.END_STOP, ReferenceKind.MARK

# Goniometers and tip-tilt mirrors are read in degrees, hence rotary. Irises have no kind: no
# document at hand says in which unit they are moved, so CoSMic refuses to move them in closed
# loop. A reference that no document names counts as none.
_TYPES: Final[dict[int, tuple[str, PositionerKind | None, ReferenceKind]]] = {
    0: ("no sensor", PositionerKind.OPEN_LOOP, _NONE),
    1: ("M, linear SLC-xxxxm", _LINEAR, _END),
    2: ("GA, goniometer 43.5 mm", _ROTARY, _NONE),
    3: ("GB, goniometer 56 mm", _ROTARY, _NONE),
    4: ("GC, rotary SR-1910m with end stops", _ROTARY, _END),
    5: ("GD, goniometer 60.5 mm", _ROTARY, _END),
    6: ("GE, goniometer 77.5 mm", _ROTARY, _END),
    7: ("RA, rotary with absolute sensor", _ROTARY, _NONE),
    8: ("GF, rotary SR-1209m with end stops", _ROTARY, _END),
    9: ("RB, rotary SR-1910m", _ROTARY, _NONE),
    10: ("SR36M, rotary", _ROTARY, _NONE),
    11: ("SR36ME, rotary with end stops", _ROTARY, _END),
    12: ("SR50M, rotary", _ROTARY, _NONE),
    13: ("SR50ME, rotary with end stops", _ROTARY, _END),
    14: ("MM50, magnetic linear", _LINEAR, _END),
    15: ("G935M, goniometer 104.75 mm", _ROTARY, _END),
    16: ("MD, linear, double piezo", _LINEAR, _END),
    17: ("TT254, tip-tilt", _ROTARY, _NONE),
    18: ("LC, linear, distance coded", _LINEAR, _MARK),
    19: ("LR, rotary, single coded", _ROTARY, _MARK),
    20: ("LCD, linear, distance coded, double piezo", _LINEAR, _MARK),
    21: ("L, linear, single coded", _LINEAR, _MARK),
    22: ("LD, linear, single coded, double piezo", _LINEAR, _MARK),
    23: ("LE, linear", _LINEAR, _END),
    24: ("LED, linear, double piezo", _LINEAR, _END),
    25: ("SL_S1I1E1, linear, inductive 293 nm", _LINEAR, _END),
    26: ("SL_D1I1E1, linear, inductive 293 nm", _LINEAR, _END),
    27: ("SL_S1I2E2, linear, inductive 73 nm", _LINEAR, _END),
    28: ("SL_D1I2E2, linear, inductive 73 nm", _LINEAR, _END),
    29: ("ST_S1I1E2, tip-tilt 25.4 mm", _ROTARY, _NONE),
    30: ("SG_D1L1S, goniometer 60.5 mm", _ROTARY, _MARK),
    31: ("SG_D1L1E, goniometer 60.5 mm", _ROTARY, _END),
    32: ("SG_D1L2S, goniometer 77.5 mm", _ROTARY, _MARK),
    33: ("SG_D1L2E, goniometer 77.5 mm", _ROTARY, _END),
    34: ("SG_D1M1E, goniometer 60.5 mm", _ROTARY, _END),
    35: ("SG_D1M2E, goniometer 77.5 mm", _ROTARY, _END),
    36: ("SI_S1L1S, iris", None, _MARK),
    37: ("ST_S1I2E2, tip-tilt 50.8 mm", _ROTARY, _NONE),
    38: ("SR_T5L3S, rotary", _ROTARY, _NONE),
    39: ("SI_S1L4E, iris", None, _NONE),
    40: ("SI_S1L1E, iris", None, _NONE),
    41: ("SI_S1L3E, iris", None, _NONE),
}


def positioner_type(code: int) -> PositionerType:
    """Return what `code` stands for; an unknown code has no kind and no reference."""
    name, kind, reference = _TYPES.get(code, (f"unknown type {code}", None, _NONE))
    return PositionerType(code=code, name=name, kind=kind, reference=reference)
