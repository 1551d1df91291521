"""How calibrations are made, and how good and how fresh they must be; a part of a recipe."""

from pydantic import Field

from cosmic.frame.config import StrictModel


class CalibrationSettings(StrictModel):
    """How good and how fresh calibrations must be.

    Attributes
    ----------
    place_x_um, place_y_um, place_um : float
        Where the gripper is looked at above the plate.
    residual_px : float
        Largest RMS residual of a map.
    rotation_std_um : float
        Largest standard deviation of the rotation centre.
    age_s : float
        Oldest calibration that is used, on the platform's clock.
    rotation_centre : bool
        The rotation centre is measured; otherwise it is taken to be the platform's origin.
    compare_zoom : float
        Magnification at which probe and gripper are seen together.
    compare_x_um : float
        Where the gripper is looked at there.
    compare_beside_um, compare_before_um : float
        How far ahead of the jaws, and how far in front of where a fibre is held, the probe stands.
    heights : bool
        Heights are measured by focus; otherwise they are taken to be as the platform file says.
    focus_zoom, focus_wide_zoom : float
        Magnification at which they are measured, and the one where nothing with edges is in view.
    focus_x_um, focus_y_um : float
        Where tips stand meanwhile: in the middle of the image.
    focus_um_count : float
        About what a count of the focus is worth; what it is worth is measured.
    focus_reach_um, focus_frames : float, int
        How far a sweep goes to both sides, and how many images it has.
    lying_um : float
        How high above the plate that is in focus which lies on it.
    height_um : float
        Largest standard deviation of a height.
    touch : bool
        The probe feels for the jaws before fibres are handled; otherwise only the image says
        where it is.
    touch_behind_um, touch_below_um : float
        How far behind the tips of the jaws, and above their lower edge, the probe touches.
    touch_closing_um : float
        How much further than their travel the jaws are closed before.
    touch_stand_off_um : float
        How far before the jaw, as the image shows it, the small steps begin.
    touch_step_v, touch_step_um : float
        Amplitude of these steps, and how long one may be: even a rigid jaw must be felt before the
        force is too high.
    touch_un, touch_average_s : float
        Force that means contact, and the time over which it is averaged after each step.
    touches : int
        How often the jaw is touched.
    touch_off_um : float
        How far touch and image may disagree.
    touch_std_um : float
        Largest standard deviation of the position found by touch.
    zooms_gap_um, zooms_small_um_px : float
        Opening of the jaws at zooms where a pixel is smaller than that.
    zooms_ahead_um : float
        How far ahead of there the gripper's tip can go.
    drift_fibres : int
        After so many fibres the tips are looked for again; 0: never.
    drift_um, drift_far_um : float
        What has moved further is followed; what has moved so far is measured anew.
    lens_far_um : float
        By how much the image may come to rest elsewhere when the zoom has run; beyond that maps are
        measured anew.
    tries : int
        How often each is tried; between two tries the table turns, for what lies below may hide
        the tools.
    """

    place_x_um: float = -1900.0
    place_y_um: float = 0.0
    place_um: float = 12.0
    residual_px: float = Field(0.5, gt=0.0)
    rotation_std_um: float = Field(3.0, gt=0.0)
    age_s: float = Field(7200.0, gt=0.0)
    rotation_centre: bool = True
    compare_zoom: float = Field(1.0, gt=0.0)
    compare_x_um: float = -500.0
    compare_beside_um: float = 700.0
    compare_before_um: float = 250.0
    heights: bool = True
    focus_zoom: float = Field(5.0, gt=0.0)
    focus_wide_zoom: float = Field(2.0, gt=0.0)
    focus_x_um: float = 0.0
    focus_y_um: float = 0.0
    focus_um_count: float = Field(0.375, gt=0.0)
    focus_reach_um: float = Field(120.0, gt=0.0)
    focus_frames: int = Field(9, ge=5, le=99)
    lying_um: float = Field(4.0, ge=0.0)
    height_um: float = Field(12.0, gt=0.0)
    zooms_gap_um: float = Field(60.0, gt=0.0)
    zooms_ahead_um: float = Field(1200.0, gt=0.0)
    zooms_small_um_px: float = Field(1.5, gt=0.0)
    drift_fibres: int = Field(10, ge=0)
    drift_um: float = Field(1.0, gt=0.0)
    drift_far_um: float = Field(40.0, gt=0.0)
    lens_far_um: float = Field(150.0, gt=0.0)
    touch: bool = False
    touch_behind_um: float = Field(300.0, gt=50.0)
    touch_below_um: float = 60.0
    touch_closing_um: float = Field(100.0, ge=0.0)
    touch_stand_off_um: float = Field(20.0, gt=0.0, le=100.0)
    touch_step_v: float = Field(15.0, ge=15.0, le=40.0)
    touch_step_um: float = Field(0.15, gt=0.0, le=1.0)
    touch_un: float = Field(2.0, gt=0.0)
    touch_average_s: float = Field(0.01, gt=0.0)
    touches: int = Field(3, ge=1, le=20)
    touch_off_um: float = Field(10.0, gt=0.0)
    touch_std_um: float = Field(0.5, gt=0.0)
    tries: int = Field(5, ge=1, le=20)
