"""The types of arrays that many files speak of; shape and unit stand where one is used."""

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Floats32 = npt.NDArray[np.float32]
"""As OpenCV filters them."""
Mask = npt.NDArray[np.bool_]
ByteMask = npt.NDArray[np.uint8]
"""As OpenCV takes a mask: 0, or anything else."""
Pixels = npt.NDArray[np.uint8] | npt.NDArray[np.uint16]
"""An image as a camera gives it."""
