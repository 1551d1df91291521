"""Bending stiffness in the units of the stages and of the world."""

from typing import Final

UN_UM2_PER_N_M2: Final = 1e18
N_M2_PER_UN_UM2: Final = 1e-18
