"""Public names that changed still work for one version, with a warning."""

import importlib

import pytest

from cosmic.frame.renamed import Renamed
from system.api_names import CLASSES

IN_MODULES = {
    "cosmic.vico.core.recording.reading": ("open_picture_recording", "open_image_recording"),
    "cosmic.vico.core.recording.export": ("export_pictures", "export_images"),
    "cosmic.vico.core.recording.snap": ("save_picture", "save_image"),
    "cosmic.mico.api.planned_path": ("Way", "PlannedPath"),
}
OLD = [
    (title, name)
    for title, cls in CLASSES.items()
    for name, each in vars(cls).items()
    if isinstance(each, Renamed)
]


@pytest.mark.parametrize(("title", "name"), OLD)
def test_an_old_name_leads_to_one_that_is_there(title: str, name: str) -> None:
    cls = CLASSES[title]
    renamed = vars(cls)[name]
    fields = getattr(cls, "__dataclass_fields__", {})
    assert hasattr(cls, renamed.name) or renamed.name in fields


def test_the_old_names_of_a_camera_are_kept() -> None:
    kept = {name for title, name in OLD if title == "CameraHandle"}
    assert {"next_picture", "plan_pictures", "picture_since", "on_picture"} <= kept


def test_the_old_names_of_the_axes_are_kept() -> None:
    kept = {name for title, name in OLD if title in ("Mico", "Declared")}
    assert {"find_way", "elsewhere", "moves_elsewhere"} <= kept


def test_an_old_module_leads_to_the_new_one() -> None:
    old = importlib.import_module("cosmic.mico.api.ways")
    new = importlib.import_module("cosmic.mico.api.planned_path")
    with pytest.warns(DeprecationWarning, match="planned_path"):
        assert old.PlannedPath is new.PlannedPath


@pytest.mark.parametrize(("module", "names"), IN_MODULES.items())
def test_an_old_function_of_a_module_is_the_new_one(module: str, names: tuple[str, str]) -> None:
    loaded, (old, new) = importlib.import_module(module), names
    with pytest.warns(DeprecationWarning, match=new):
        assert getattr(loaded, old) is getattr(loaded, new)
