"""A scene that is wrong is refused, with a line that says where, what and what to do."""

import re
from pathlib import Path

import pytest

from cosmic.mico.core.collision.scene_loader import find_scene_mistakes, load_scene
from unit.mico.scene_writer import (
    SLIDER_BOX,
    SLIDER_MESH,
    block,
    mistakes,
    write_part,
    write_scene,
)

SLIDE = '<joint name="slide" type="prismatic">\n    <parent link="base"/><child link="slider"/>'
ORIGIN = '<origin xyz="0 0 0.002"/>'
LIMIT = '<limit lower="-0.006" upper="0.006"'


def warnings(path: Path) -> str:
    found, odd = find_scene_mistakes(path)
    assert found == []
    load_scene(path)
    return "\n".join(odd)


def test_a_sound_scene_has_neither_mistakes_nor_warnings(tmp_path: Path) -> None:
    assert find_scene_mistakes(write_scene(tmp_path)) == ([], [])


URDF_MISTAKES = {
    "a place that is nan": ({ORIGIN: '<origin xyz="0 nan 0"/>'}, "link 'slider'.*not finite"),
    "a place that is infinite": ({ORIGIN: '<origin xyz="inf 0 0"/>'}, "not finite"),
    "a place beyond all sense": ({ORIGIN: '<origin xyz="1e308 0 0"/>'}, "above 1e.09"),
    "an angle that is nan": ({ORIGIN: '<origin rpy="0 0 nan"/>'}, "rpy.*not finite"),
    "a place of two numbers": ({ORIGIN: '<origin xyz="0 0"/>'}, "3 numbers are wanted"),
    "a place in words": ({ORIGIN: '<origin xyz="a b c"/>'}, "not a number"),
    "a limit that is nan": ({LIMIT: '<limit lower="nan" upper="1"'}, "joint 'slide'.*not finite"),
    "an axis that is nan": ({'xyz="0 0 2"': 'xyz="0 nan 2"'}, "axis.*not finite"),
    "an axis without length": ({'xyz="0 0 2"': 'xyz="0 0 0"'}, "joint 'slide': its axis has no"),
    "no limits": ({f'{LIMIT} effort="1" velocity="1"/>': ""}, "joint 'slide': it has no limits"),
    "limits crossed": ({LIMIT: '<limit lower="1" upper="-1"'}, "lower limit is not below"),
    "a side of 0": ({"0.05 0.05 0.01": "0.05 0 0.01"}, "must be larger than 0"),
    "a radius below 0": ({'radius="0.003"': 'radius="-1"'}, "radius.*must be larger than 0"),
    "a floating joint": ({'type="prismatic"': 'type="floating"'}, "'floating' is not known"),
    "a planar joint": ({'type="revolute"': 'type="planar"'}, "'planar' is not known"),
    "no type": ({' type="revolute"': ""}, "joint 'turn': <joint> has no 'type'"),
    "an unknown shape": ({"<cylinder": "<capsule"}, "link 'table'.*needs one <geometry>"),
    "no shape": ({'<cylinder radius="0.003" length="0.002"/>': ""}, "needs one <geometry>"),
    "an unknown child": ({'child link="slider"': 'child link="slyder"'}, "'slyder' is not a link"),
    "an unknown parent": ({SLIDE: SLIDE.replace("base", "bass")}, "parent 'bass' is not a link"),
    "a link twice": ({'link name="table"': 'link name="slider"'}, "'slider' is there 2 times"),
    "a joint twice": ({'joint name="turn"': 'joint name="slide"'}, "'slide' is there 2 times"),
    "a child with two parents": (
        {'<child link="table"/>': '<child link="slider"/>'},
        "'slider' has two parents",
    ),
    "a loop": ({SLIDE: SLIDE.replace("base", "slider")}, "own child"),
    "no parent": ({'<parent link="base"/>': ""}, "joint 'slide': it needs one <parent>"),
    "xacro": ({"<robot": '<robot xmlns:x="urn:x"><x:macro/></robot><robot'}, "not valid XML"),
    "not closed": ({"</robot>": ""}, r"small\.urdf: not valid XML"),
    "another root": ({"<robot": "<model", "</robot>": "</model>"}, "the root is <model>"),
}


@pytest.mark.parametrize("name", URDF_MISTAKES)
def test_a_urdf_is_refused_with(tmp_path: Path, name: str) -> None:
    urdf, wanted = URDF_MISTAKES[name]
    text = mistakes(write_scene(tmp_path, urdf=urdf))
    assert re.search(wanted, text), text
    assert "small.urdf" in text


def test_the_line_of_a_mistake_is_reported(tmp_path: Path) -> None:
    text = mistakes(write_scene(tmp_path, urdf={ORIGIN: '<origin xyz="0 nan 0"/>'}))
    assert "small.urdf:10: link 'slider'" in text


def test_joints_in_a_circle_are_refused(tmp_path: Path) -> None:
    joint = '<parent link="{}"/><child link="{}"/>'
    urdf = {
        joint.format("base", "slider"): joint.format("table", "slider"),
        joint.format("base", "table"): joint.format("slider", "table"),
    }
    path = write_scene(tmp_path, urdf=urdf)
    assert "loop of joints" in mistakes(path)


def test_a_circle_of_all_links_has_no_root(tmp_path: Path) -> None:
    third = '<joint name="back" type="fixed"><parent link="table"/><child link="base"/></joint>'
    text = mistakes(write_scene(tmp_path, urdf={"</robot>": f"{third}</robot>"}))
    assert "no root: its joints loop" in text


def test_two_roots_are_refused(tmp_path: Path) -> None:
    text = mistakes(write_scene(tmp_path, urdf={"</robot>": '<link name="alone"/></robot>'}))
    assert "2 roots: base, alone" in text


def test_several_mistakes_are_reported_at_once(tmp_path: Path) -> None:
    path = write_scene(
        tmp_path,
        urdf={ORIGIN: '<origin xyz="0 nan 0"/>', 'type="revolute"': 'type="planar"'},
        srdf={'link1="base"': 'link1="bass"'},
    )
    text = mistakes(path)
    assert "not finite" in text
    assert "'planar'" in text


def test_a_doctype_is_refused(tmp_path: Path) -> None:
    bomb = "".join(f'<!ENTITY a{n} "{f"&a{n - 1};" * 10}">' for n in range(1, 12))
    doctype = f'<!DOCTYPE robot [<!ENTITY a0 "ha">{bomb}]>\n<robot name="&a11;"'
    path = write_scene(tmp_path, urdf={'<robot name="small"': doctype})
    assert "small.urdf" in mistakes(path)


def test_a_file_is_not_read_through_an_entity(tmp_path: Path) -> None:
    (tmp_path / "secret").write_text("secret")
    doctype = '<!DOCTYPE robot [<!ENTITY s SYSTEM "secret">]>\n<robot'
    path = write_scene(tmp_path, srdf={"<robot": doctype, "Adjacent": "Adjacent"})
    text = mistakes(path)
    assert "DOCTYPE" in text
    assert "secret" not in text


SRDF_MISTAKES = {
    "an unknown link": ({'link1="base"': 'link1="bass"'}, "'bass' is not a link"),
    "no reason": ({' reason="Adjacent"': ""}, "base and table may touch, but no reason"),
    "one link": ({' link2="table"': ""}, "needs link1 and link2"),
    "a link with itself": ({'link2="table"': 'link2="base"'}, "with itself is not a pair"),
}


@pytest.mark.parametrize("name", SRDF_MISTAKES)
def test_an_srdf_is_refused_with(tmp_path: Path, name: str) -> None:
    srdf, wanted = SRDF_MISTAKES[name]
    text = mistakes(write_scene(tmp_path, srdf=srdf))
    assert "small.srdf:2" in text
    assert wanted in text


LIFT = '[[drive]]\naxis = "other"\njoint = '
TOML_MISTAKES = {
    "an unknown key": ("speed = 3\n", "unknown key"),
    "an unknown joint": (f'{LIFT}"slyde"\n', "'slyde' is not a joint that moves; there are slide"),
    "a joint driven twice": (f'{LIFT}"slide"\n', "'slide' is driven by lift already"),
    "a factor of 0": ("factor = 0.0\n", "factor: 0 would move nothing"),
    "a factor that is nan": ("factor = nan\n", "drive.1..factor"),
    "an offset in the wrong unit": ("offset_um = 0.0\n", "offset_um: joint 'turn' turns"),
    "an overshoot in the wrong unit": ("overshoot_um = 0.0\n", "overshoot_um: joint 'turn'"),
    "a negative overshoot": ("overshoot_deg = -1.0\n", "overshoot_deg"),
    "a zero out of reach": ("offset_deg = 100.0\n", "spin cannot be at 0"),
    "park out of reach": ("[park]\nlift = 6001.0\n", "park: lift = 6001 is outside its travel"),
    "park of an unknown axis": ("[park]\nlyft = 1.0\n", "park: 'lyft' has no"),
    "detour out of reach": ("[detour]\nlift = -7000.0\n", "detour: lift = -7000 is outside"),
    "margin of an unknown link": (
        '[[margin]]\nbodies = ["base", "bass"]\nmargin_um = 1.0\n',
        "margin[0]: 'bass' is not a link",
    ),
    "margin of a pair that is not watched": (
        '[[margin]]\nbodies = ["base", "table"]\nmargin_um = 1.0\n',
        "base and table are not watched",
    ),
    "contact of an unknown link": (
        '[[contact]]\noperation = "a"\npairs = [["base", "bass"]]\nreason = "b"\n',
        "contact[0] (a): 'bass' is not a link",
    ),
    "contact without reason": (
        '[[contact]]\noperation = "a"\npairs = [["base", "slider"]]\nreason = ""\n',
        "contact[0].reason",
    ),
    "exchange of an unknown link": ('[exchange]\nslyder = "a.urdf"\n', "'slyder' is not a link"),
    "exchange by a missing file": (
        '[exchange]\nslider = "a.urdf"\n',
        "a.urdf: there is no such file",
    ),
    "exchange by a whole platform": (
        '[exchange]\nslider = "small.urdf"\n',
        "must hold one link and no joint",
    ),
}


@pytest.mark.parametrize("name", TOML_MISTAKES)
def test_a_scene_file_is_refused_with(tmp_path: Path, name: str) -> None:
    more, wanted = TOML_MISTAKES[name]
    text = mistakes(write_scene(tmp_path, more=more))
    assert "small.toml" in text
    assert wanted.replace(".1..", "[1].") in text


def test_a_missing_scene_file_is_named(tmp_path: Path) -> None:
    assert "there is no such file" in mistakes(tmp_path / "none.toml")


@pytest.mark.parametrize("name", ["small.urdf", "small.srdf"])
def test_a_missing_description_is_named(tmp_path: Path, name: str) -> None:
    path = write_scene(tmp_path)
    (tmp_path / name).unlink()
    assert f"{name}: there is no such file" in mistakes(path)


def test_a_urdf_in_millimetres_is_recognised(tmp_path: Path) -> None:
    text = mistakes(write_scene(tmp_path, urdf={"0.05 0.05 0.01": "50 50 10"}))
    assert "link 'base' is 50 m large; URDF counts in metres" in text


def test_a_mesh_in_millimetres_without_a_scale_is_recognised(tmp_path: Path) -> None:
    write_part(tmp_path, block())
    urdf = {SLIDER_BOX: SLIDER_MESH.replace(' scale="0.001 0.001 0.001"', "")}
    assert "link 'slider' is 4 m large" in mistakes(write_scene(tmp_path, urdf=urdf))


def test_a_body_below_a_micrometre_is_recognised(tmp_path: Path) -> None:
    urdf = {SLIDER_BOX: SLIDER_BOX.replace("0.004 0.002 0.001", "4e-7 2e-7 1e-7")}
    assert "link 'slider' is 0.4 um large" in mistakes(write_scene(tmp_path, urdf=urdf))


def test_a_body_far_away_is_recognised(tmp_path: Path) -> None:
    text = mistakes(write_scene(tmp_path, urdf={ORIGIN: '<origin xyz="0 0 2.5"/>'}))
    assert "link 'slider' reaches 2.5" in text


def test_bodies_that_overlap_at_home_are_named(tmp_path: Path) -> None:
    text = mistakes(write_scene(tmp_path, urdf={ORIGIN: '<origin xyz="0.014 0 0.001"/>'}))
    assert "at home, all axes at 0, 'slider' and 'table' overlap" in text


def test_a_body_wholly_inside_another_overlaps_at_home(tmp_path: Path) -> None:
    text = mistakes(write_scene(tmp_path, urdf={ORIGIN: '<origin xyz="0 0 -0.01"/>'}))
    assert "'base' and 'slider' overlap" in text


def test_bodies_that_overlap_when_parked_are_named(tmp_path: Path) -> None:
    lower = {ORIGIN: '<origin xyz="0 0 0.001"/>'}
    text = mistakes(write_scene(tmp_path, urdf=lower, more="[park]\nlift = -6000.0\n"))
    assert "park: 'base' and 'slider' overlap" in text


def test_bodies_within_their_margin_at_home_are_warned_of(tmp_path: Path) -> None:
    text = warnings(write_scene(tmp_path, toml={"margin_um = 5.0": "margin_um = 7000.0"}))
    assert "'base' and 'slider' may be closer than their margin of 7000 um" in text


def test_an_srdf_that_allows_everything_is_warned_of(tmp_path: Path) -> None:
    line = '  <disable_collisions link1="{}" link2="slider" reason="Default"/>\n'
    more = line.format("base") + line.format("table")
    text = warnings(write_scene(tmp_path, srdf={"</robot>": f"{more}</robot>"}))
    assert "small.srdf: every pair is allowed to touch: nothing at all is watched" in text


def test_a_body_that_may_touch_everything_is_warned_of(tmp_path: Path) -> None:
    line = '<disable_collisions link1="table" link2="slider" reason="Never"/>'
    text = warnings(write_scene(tmp_path, srdf={"</robot>": f"{line}</robot>"}))
    assert "'table' may touch everything it can meet" in text


CLIP = """<collision>
    <origin xyz="0.018 0 0.001"/><geometry><box size="0.002 0.002 0.0004"/></geometry></collision>
  </link>"""
GRASP = """
[[contact]]
operation = "grasp"
pairs = [["slider", "table"]]
reason = "it takes things up"
"""


def test_a_plate_that_may_be_touched_with_what_stands_on_it_is_warned_of(tmp_path: Path) -> None:
    end = '<cylinder radius="0.003" length="0.002"/></geometry></collision>\n  </link>'
    clipped = {end: end.replace("\n  </link>", CLIP)}
    plate = {"margin_um = 5.0": 'margin_um = 5.0\nplate = "table"'}

    text = warnings(write_scene(tmp_path, urdf=clipped, toml=plate, more=GRASP))

    assert "contact 'grasp' lets bodies run into all of 'table'" in text
    assert "differ in height by 200 um" in text
    assert "link of its own" in text
    assert not warnings(write_scene(tmp_path, urdf=clipped, toml=plate))
    assert not warnings(write_scene(tmp_path, toml=plate, more=GRASP))


def test_a_joint_without_a_drive_is_warned_of(tmp_path: Path) -> None:
    toml = {'\n[[drive]]\naxis = "spin"\njoint = "turn"\n': ""}
    assert "joint 'turn' has no [[drive]]" in warnings(write_scene(tmp_path, toml=toml))


def test_elements_that_are_not_used_are_warned_of(tmp_path: Path) -> None:
    path = write_scene(
        tmp_path,
        urdf={'<axis xyz="0 0 2"/>': '<axis xyz="0 0 2"/><mimic joint="turn"/>'},
        srdf={"</robot>": '<group name="arm"/></robot>'},
    )
    text = warnings(path)
    assert "<mimic> is not used" in text
    assert "<group> is not used" in text


def test_a_hash_of_a_file_that_is_not_used_is_warned_of(tmp_path: Path) -> None:
    path = write_scene(tmp_path, more=f'[sha256]\n"old.stl" = "{"0" * 64}"\n')
    assert "sha256: 'old.stl' is not a file of this scene" in warnings(path)
