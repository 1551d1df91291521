"""The pages about scenes are true: their tables are complete, and following them works."""

import re
import shutil
from pathlib import Path

import pytest
from pydantic import BaseModel, create_model

from cosmic.frame.config import shipped_config_dir
from cosmic.mico.core.collision.scene_loader import find_scene_mistakes, load_scene
from cosmic.mico.core.collision.scene_settings import (
    ContactSettings,
    DriveSettings,
    MarginSettings,
    SceneSettings,
    SizeLimits,
    ToolFrameSettings,
)
from system.config_tables import rows
from system.docs_blocks import ROOT, blocks, table_rows

PAGE = ROOT / "docs" / "how-to" / "describe-your-platform.md"
REFERENCE = ROOT / "docs" / "reference" / "scene.md"

TOP = {name: SceneSettings.model_fields[name] for name in ("urdf", "srdf", "margin_um", "plate")}
SECTIONS: dict[str, type[BaseModel]] = {
    "scene": create_model("Top", **{name: (f.annotation, f) for name, f in TOP.items()}),
    "[[drive]]": DriveSettings,
    "[[margin]]": MarginSettings,
    "[[contact]]": ContactSettings,
    "[[tool]]": ToolFrameSettings,
    "[limits]": SizeLimits,
}


@pytest.mark.parametrize("heading", SECTIONS)
def test_the_reference_lists_every_key_of(heading: str, tmp_path: Path) -> None:
    text = REFERENCE.read_text(encoding="utf-8")
    parts = re.split(r"^#+ (.*)$", text, flags=re.MULTILINE)
    headings = [each.strip().strip("`") for each in parts[1::2]]
    (tmp_path / "part.md").write_text(parts[2 * headings.index(heading) + 2], encoding="utf-8")
    _, *listed = table_rows(tmp_path / "part.md")
    assert [tuple(row[:4]) for row in listed] == list(rows(SECTIONS[heading]))


def test_the_reference_names_every_table() -> None:
    text = REFERENCE.read_text(encoding="utf-8")
    for name in SceneSettings.model_fields:
        assert f"`{name}`" in text or f"[{name}]" in text, name


def followed(folder: Path) -> Path:
    """The shipped scene with everything that the page adds to it."""
    shutil.copytree(shipped_config_dir() / "scenes", folder)
    for block in blocks(PAGE):
        if block.language == "toml":
            with (folder / "fiberstation.toml").open("a", encoding="utf-8") as file:
                file.write(f"\n{block.text}")
        if block.language != "xml":
            continue
        if block.text.startswith("<robot"):
            (folder / "short_gripper.urdf").write_text(block.text, encoding="utf-8")
            continue
        kind = "srdf" if block.text.startswith("<disable") else "urdf"
        path = folder / f"fiberstation.{kind}"
        text = path.read_text(encoding="utf-8")
        path.write_text(text.replace("</robot>", f"{block.text}</robot>"), encoding="utf-8")
    return folder / "fiberstation.toml"


def test_following_the_page_makes_a_sound_scene(tmp_path: Path) -> None:
    path = followed(tmp_path / "scenes")
    assert find_scene_mistakes(path) == ([], [])
    scene = load_scene(path)
    assert "lamp.x" in scene.axes
    assert sum(piece.body == "lamp" for piece in scene.pieces) == 2
    margins = {watched.bodies: watched.margin_um for watched in scene.pairs}
    assert margins["lamp", "objective"] == 500.0
    assert ("lamp", "lamp_base") not in margins
    assert "wipe" in {contact.name for contact in scene.contacts}


def test_the_exchanged_gripper_is_mounted_where_the_usual_one_was(tmp_path: Path) -> None:
    usual = load_scene(shipped_config_dir() / "scenes" / "fiberstation.toml")
    changed = load_scene(followed(tmp_path / "scenes"))
    reach = []
    for scene in (usual, changed):
        (piece,) = (each for each in scene.pieces if each.body == "left_gripper")
        reach.append((piece.vertices_um[:, 0].min(), piece.vertices_um[:, 0].max()))
    assert reach == [(0.0, 8000.0), (0.0, 6000.0)]
