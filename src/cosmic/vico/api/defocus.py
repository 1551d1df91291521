"""The focus from two images, and the model that it takes, calibrated once for a zoom position."""

from cosmic.vico.core.defocus import DefocusModel as DefocusModel
from cosmic.vico.core.defocus import InFocus as InFocus
from cosmic.vico.core.defocus import blur_difference as blur_difference
from cosmic.vico.core.defocus import calibrate as calibrate
from cosmic.vico.core.defocus import in_focus as in_focus
