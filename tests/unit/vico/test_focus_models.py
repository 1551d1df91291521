"""What sweeps taught of the blur is kept, for the view it was learned in."""

from pathlib import Path

import pytest

from cosmic.frame.errors import ConfigError
from cosmic.vico.core.defocus import DefocusModel
from cosmic.vico.core.focus_models import FILE, FocusModels, View

MODEL = DefocusModel(2e-5, 1e-6)


def test_a_model_holds_for_its_camera_binning_and_zoom_alone() -> None:
    models = FocusModels()
    models.learn(View("top", 5964.0), MODEL)
    assert models.find(View("top", 5970.0)) == MODEL
    for other in (View("top", 6100.0), View("side", 5964.0), View("top", 5964.0, 2)):
        assert models.find(other) is None


def test_what_was_learned_is_there_after_a_restart(tmp_path: Path) -> None:
    models = FocusModels()
    models.keep_in(tmp_path / "calibration")
    models.learn(View("top", 100.0), DefocusModel(1e-5, 1e-6))
    models.learn(View("top", 105.0), MODEL)  # in its place
    models.learn(View("top", 900.0), DefocusModel(3e-5, 1e-6))
    again = FocusModels()
    again.keep_in(tmp_path / "calibration")
    assert again.find(View("top", 100.0)) == MODEL
    assert again.find(View("top", 900.0)) == DefocusModel(3e-5, 1e-6)
    assert (tmp_path / "calibration" / FILE).read_text().count("\n[[blur]]\n") == 2


def test_a_broken_file_is_named_with_its_key(tmp_path: Path) -> None:
    (tmp_path / FILE).write_text("format = 1\n[[blur]]\ncamera = 'top'\nbinning = 0\n")
    with pytest.raises(ConfigError, match=r"focus\.toml.*binning"):
        FocusModels().keep_in(tmp_path)
