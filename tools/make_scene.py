"""Makes the scene that ships with CoSMic: config/scenes/fiberstation.urdf and its meshes.

Run `python tools/make_scene.py` after a change here; the same input gives the same bytes.
Lengths here are millimetres, as in a drawing. World: z up, x right, y away from the operator,
origin on the axis of the rotary table, on the top of the sample plate.
"""

import argparse
import math
from dataclasses import dataclass, field
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np
import trimesh

SCENES = Path(__file__).resolve().parents[1] / "config" / "scenes"
COLOURS = {
    "aluminium": (0.78, 0.79, 0.81, 1.0),
    "anodised": (0.30, 0.32, 0.36, 1.0),
    "steel": (0.62, 0.65, 0.70, 1.0),
    "screw": (0.16, 0.16, 0.18, 1.0),
    "frame": (0.20, 0.21, 0.24, 1.0),
    "pedestal": (0.36, 0.37, 0.40, 1.0),
    "glass": (0.72, 0.86, 0.92, 0.40),
    "clip": (0.85, 0.55, 0.15, 1.0),
    "board": (0.08, 0.42, 0.22, 1.0),
    "silicon": (0.35, 0.36, 0.48, 1.0),
    "barrel": (0.12, 0.12, 0.13, 1.0),
    "ring": (0.70, 0.71, 0.73, 1.0),
    "band": (0.90, 0.75, 0.15, 1.0),
    "rotor": (0.70, 0.71, 0.73, 1.0),
}
Vector = tuple[float, float, float]
TRAVEL = 6.0


@dataclass
class Solid:
    """A shape at a place in the world: of a body's collision pieces, of its views, or of both."""

    geometry: str
    place: Vector
    rpy: Vector = (0.0, 0.0, 0.0)
    colour: str = "aluminium"
    name: str = ""
    solid: bool = True
    seen: bool = True


@dataclass
class Link:
    """A body with its frame in the world, and how it hangs on its parent."""

    name: str
    parent: str = ""
    place: Vector = (0.0, 0.0, 0.0)
    turned: bool = False  # half a turn about z, as the right-hand assembly is
    joint: str = ""
    kind: str = "fixed"
    axis: Vector = (1.0, 0.0, 0.0)
    limits: tuple[float, float] = (0.0, 0.0)
    solids: list[Solid] = field(default_factory=list)


def number(value: float) -> str:
    """Write a number as short as it goes, never as -0."""
    return f"{round(value, 9) + 0.0:.9g}"


def radians_outward(angle_deg: float) -> str:
    """Radians rounded away from 0, so that the limit in whole degrees is within the travel."""
    return f"{math.copysign(math.ceil(math.radians(abs(angle_deg)) * 1e12) / 1e12, angle_deg):.13g}"


def metres(*lengths_mm: float) -> str:
    """Write millimetres in metres."""
    return " ".join(number(length / 1000.0) for length in lengths_mm)


def middle(low: Vector, high: Vector) -> Vector:
    """Return the middle between two corners."""
    x, y, z = ((a + b) / 2.0 for a, b in zip(low, high, strict=True))
    return x, y, z


def box(low: Vector, high: Vector, colour: str = "aluminium", **more: object) -> Solid:
    """Make a box between two corners."""
    sides = [b - a for a, b in zip(low, high, strict=True)]
    geometry = f'<box size="{metres(*sides)}"/>'
    return Solid(geometry, middle(low, high), colour=colour, **more)


def cylinder(
    radius: float,
    low: float,
    high: float,
    colour: str,
    at: tuple[float, float] = (0.0, 0.0),
    **more: object,
) -> Solid:
    """Make an upright cylinder between two heights."""
    geometry = f'<cylinder radius="{metres(radius)}" length="{metres(high - low)}"/>'
    return Solid(geometry, (*at, (low + high) / 2.0), colour=colour, **more)


def mesh(file: str, place: Vector, colour: str, **more: object) -> Solid:
    """Put a mesh of config/scenes/meshes somewhere."""
    geometry = f'<mesh filename="meshes/{file}" scale="0.001 0.001 0.001"/>'
    return Solid(geometry, place, colour=colour, **more)


def stage_half(low: Vector, high: Vector, rpy: Vector = (0.0, 0.0, 0.0)) -> list[Solid]:
    """Make one half of a stage: a box to the gate, a chamfered body to the eye."""
    return [
        box(low, high, seen=False, name="stage"),
        mesh("stage.stl", middle(low, high), "aluminium", rpy=rpy, solid=False),
    ]


def write_stl(name: str, made: trimesh.Trimesh) -> None:
    """Write a mesh, in mm."""
    folder = SCENES / "meshes"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / name).write_bytes(trimesh.exchange.stl.export_stl(made))


def hull(points: list[Vector]) -> trimesh.Trimesh:
    """Return the convex hull."""
    return trimesh.convex.convex_hull(np.array(points))


def chamfered(x: float, y: float, z: float, cut: float) -> trimesh.Trimesh:
    """Make a box about the origin whose edges are cut."""
    points = []
    for sx in (-1, 1):
        for sy in (-1, 1):
            for sz in (-1, 1):
                for axis in range(3):
                    corner = [sx * (x / 2 - cut), sy * (y / 2 - cut), sz * (z / 2 - cut)]
                    corner[axis] += (sx, sy, sz)[axis] * cut
                    points.append(tuple(corner))
    return hull(points)


def lathe(profile: list[tuple[float, float]], sides: int) -> trimesh.Trimesh:
    """Make a body of revolution about z; `profile` is radius and height, axis to axis."""
    return trimesh.creation.revolve(np.array(profile), sections=sides)


def rings(profile: list[tuple[float, float]], sides: int) -> list[Vector]:
    """Return the corners of rings about z, each around the circle of its radius."""
    around = 1.0 / math.cos(math.pi / sides)
    angles = [2.0 * math.pi * k / sides for k in range(sides)]
    return [
        (radius * around * math.cos(angle), radius * around * math.sin(angle), z)
        for radius, z in profile
        for angle in angles
    ]


def jaw() -> trimesh.Trimesh:
    """Make a finger 6 long along -x, 0.1 thick, 0.15 to 0.5 high; its tip is at 0."""
    points = []
    for y in (-0.05, 0.05):
        points += [(0.0, y, 0.0), (0.0, y, 0.15), (-6.0, y, 0.0), (-6.0, y, 0.5)]
    return hull(points)


def make_meshes() -> None:
    """Write all meshes."""
    write_stl("stage.stl", chamfered(22.0, 17.0, 4.2, 0.5))
    screws = [
        trimesh.creation.cylinder(
            radius=1.1, height=0.1, sections=12,
            transform=trimesh.transformations.translation_matrix((x, y, 2.07)),
        )
        for x in (-8.0, 8.0)
        for y in (-5.5, 5.5)
    ]  # fmt: skip
    write_stl("screws.stl", trimesh.util.concatenate(screws))
    write_stl("jaw.stl", jaw())
    write_stl("gripper.stl", chamfered(8.0, 10.0, 3.7, 0.6))
    cone = [(0.0, 0.0), (6.0, 0.0), (14.8, 12.0), (0.0, 12.0)]
    write_stl("cone.stl", lathe(cone, 48))
    write_stl("cone_hull.stl", hull(rings([(6.0, 0.0), (15.0, 12.0)], 24)))
    write_stl(
        "rotor.stl", lathe([(0.0, -2.0), (9.5, -2.0), (9.5, 1.5), (9.0, 2.0), (0.0, 2.0)], 48)
    )


def arm_assembly(side: str, sign: float) -> list[Link]:
    """Return stages, arm, gripper and jaws of one side; drawn for the left, mirrored in x."""

    def at(low: Vector, high: Vector) -> tuple[Vector, Vector]:
        ends = sorted((sign * low[0], sign * high[0]))
        return (ends[0], low[1], low[2]), (ends[1], high[1], high[2])

    def block(low: Vector, high: Vector, colour: str = "aluminium", **more: object) -> Solid:
        return box(*at(low, high), colour, **more)

    half = math.pi / 2.0
    flat, across = (0.0, 0.0, 0.0), (0.0, 0.0, half)
    upright = (0.0, half, 0.0)  # long side along z, thin along x
    screws = mesh("screws.stl", (sign * 52.5, 0.0, -9.09), "screw", rpy=across, solid=False)
    slide = ("prismatic", (-TRAVEL, TRAVEL))
    turned = sign > 0
    forward = 1.0 if not turned else -1.0
    return [
        Link(f"{side}_base", "frame", (sign * 52.5, 0.0, -40.0), solids=[
            block((44.0, -8.5, -40.0), (61.0, 8.5, -24.0), "pedestal", name="pedestal"),
            *stage_half(*at((41.5, -8.5, -24.0), (63.5, 8.5, -19.8)), flat),
        ]),
        Link(f"{side}_x_carriage", f"{side}_base", (sign * 52.5, 0.0, -19.7),
             joint=f"{side}_x", kind=slide[0], limits=slide[1], solids=[
            *stage_half(*at((41.5, -8.5, -19.7), (63.5, 8.5, -15.5)), flat),
            *stage_half(*at((44.0, -11.0, -15.5), (61.0, 11.0, -11.3)), across),
        ]),
        Link(f"{side}_y_carriage", f"{side}_x_carriage", (sign * 52.5, 0.0, -11.2),
             joint=f"{side}_y", kind=slide[0], axis=(0.0, 1.0, 0.0), limits=slide[1], solids=[
            *stage_half(*at((44.0, -11.0, -11.2), (61.0, 11.0, -7.0)), across),
            screws,
            block((43.0, -8.5, -7.0), (46.0, 8.5, 14.5), "anodised", name="bracket"),
            *stage_half(*at((38.8, -8.5, -7.5), (43.0, 8.5, 14.5)), upright),
        ]),
        Link(f"{side}_z_carriage", f"{side}_y_carriage", (sign * 38.7, 0.0, 3.5),
             joint=f"{side}_z", kind=slide[0], axis=(0.0, 0.0, 1.0), limits=slide[1], solids=[
            *stage_half(*at((34.5, -8.5, -7.5), (38.7, 8.5, 14.5)), upright),
            block((32.5, -8.5, -5.0), (34.5, 8.5, 12.0), "anodised", name="plate"),
        ]),
        Link(f"{side}_arm", f"{side}_z_carriage", (sign * 32.5, 0.0, 3.75), turned, solids=[
            block((18.0, -2.0, 2.5), (32.5, 2.0, 5.0), "aluminium", name="rod"),
        ]),
        Link(f"{side}_gripper", f"{side}_arm", (sign * 18.0, 0.0, 3.65), turned, solids=[
            block((10.0, -5.0, 1.8), (18.0, 5.0, 5.5), name="body", seen=False),
            mesh("gripper.stl", (sign * 14.0, 0.0, 3.65), "anodised", solid=False),
        ]),
        *(
            Link(f"{side}_jaw_{letter}", f"{side}_gripper", (sign * 4.0, 0.0, 1.5), turned,
                 joint=f"{side}_jaw_{letter}", kind="prismatic", axis=(0.0, forward, 0.0),
                 limits=limits, solids=[
                     mesh("jaw.stl", (sign * 4.0, y, 1.5), "steel", name="finger",
                          rpy=(0.0, 0.0, math.pi if turned else 0.0)),
                 ])
            for letter, y, limits in (("a", 0.05, (0.0, 0.5)), ("b", -0.05, (-0.5, 0.0)))
        ),
    ]  # fmt: skip


def probe_assembly() -> list[Link]:
    """Return two stages and the force probe, which points towards the operator."""
    across = (0.0, 0.0, math.pi / 2.0)
    return [
        Link("probe_base", "frame", (0.0, 44.5, -40.0), solids=[
            box((-8.5, 36.0, -40.0), (8.5, 53.0, -20.0), "pedestal", name="pedestal"),
            *stage_half((-11.0, 36.0, -20.0), (11.0, 53.0, -15.8)),
        ]),
        Link("probe_x_carriage", "probe_base", (0.0, 44.5, -15.7),
             joint="probe_x", kind="prismatic", limits=(-TRAVEL, TRAVEL), solids=[
            *stage_half((-11.0, 36.0, -15.7), (11.0, 53.0, -11.5)),
            *stage_half((-8.5, 33.5, -11.5), (8.5, 55.5, -7.3), across),
        ]),
        Link("probe_y_carriage", "probe_x_carriage", (0.0, 44.5, -7.2),
             joint="probe_y", kind="prismatic", axis=(0.0, 1.0, 0.0),
             limits=(-TRAVEL, TRAVEL), solids=[
            *stage_half((-8.5, 33.5, -7.2), (8.5, 55.5, -3.0), across),
            mesh("screws.stl", (0.0, 44.5, -5.09), "screw", rpy=across, solid=False),
            box((-4.5, 28.0, -3.0), (4.5, 50.0, -1.0), "anodised", name="holder"),
            box((-4.5, 28.0, -1.0), (4.5, 34.0, 2.4), "anodised", name="clamp"),
        ]),
        Link("probe_chip", "probe_y_carriage", (0.0, 28.0, 1.4), solids=[
            box((-3.0, 8.0, 0.4), (3.0, 28.0, 2.4), "board", name="board"),
            box((-1.5, 8.6, 2.4), (1.5, 12.0, 2.5), "silicon", name="sensor"),
        ]),
        Link("probe_tip", "probe_chip", (0.0, 5.0, 0.7), solids=[
            box((-0.025, 5.0, 0.675), (0.025, 8.0, 0.725), "silicon", name="shaft"),
        ]),
    ]  # fmt: skip


def table_assembly() -> list[Link]:
    """Return the rotary table with the sample plate."""
    return [
        Link("table_stage", "frame", (0.0, 0.0, -40.0), solids=[
            cylinder(8.0, -40.0, -14.0, "pedestal", name="pedestal"),
            box((-10.0, -10.0, -14.0), (10.0, 10.0, -5.1), "aluminium", name="stage"),
        ]),
        Link("table", "table_stage", (0.0, 0.0, -5.0), joint="table_rotation", kind="revolute",
             axis=(0.0, 0.0, 1.0), limits=(-170.0, 170.0), solids=[
            cylinder(9.5, -5.0, -1.0, "rotor", name="rotor", seen=False),
            mesh("rotor.stl", (0.0, 0.0, -3.0), "rotor", solid=False),
        ]),
        Link("plate", "table", (0.0, 0.0, 0.0), solids=[
            box((-12.0, -12.0, -1.0), (12.0, 12.0, 0.0), "glass", name="glass"),
        ]),
        # A body of its own: jaws may come down on the plate, but never run into its clip.
        Link("plate_clip", "plate", (0.0, 0.0, 0.0), solids=[
            box((10.0, -4.0, 0.0), (12.0, 4.0, 0.2), "clip", name="clip"),
        ]),
    ]  # fmt: skip


def standing() -> list[Link]:
    """Return what never moves: frame, objective, camera."""
    return [
        Link("frame", solids=[
            box((-90.0, -60.0, -50.0), (90.0, 100.0, -40.0), "frame", name="breadboard"),
            box((-10.0, 76.0, -40.0), (10.0, 92.0, 112.0), "frame", name="column"),
            box((-9.0, 15.0, 84.0), (9.0, 76.0, 98.0), "frame", name="arm"),
        ]),
        Link("objective", "frame", (0.0, 0.0, 50.0), solids=[
            mesh("cone_hull.stl", (0.0, 0.0, 50.0), "barrel", name="front", seen=False),
            mesh("cone.stl", (0.0, 0.0, 50.0), "barrel", solid=False),
            cylinder(15.0, 62.0, 110.0, "barrel", name="barrel", seen=False),
            cylinder(14.8, 62.0, 110.0, "barrel", solid=False),
            cylinder(15.0, 66.0, 68.0, "band", solid=False),
            cylinder(15.0, 74.0, 82.0, "ring", solid=False),
        ]),
        Link("camera", "frame", (0.0, 0.0, 110.0), solids=[
            box((-15.0, -15.0, 110.0), (15.0, 15.0, 145.0), "anodised", name="housing"),
        ]),
    ]  # fmt: skip


def shape_text(tag: str, each: Solid, link: Link) -> str:
    """Write a `<collision>` or `<visual>`, its place seen from the frame of its link."""
    place = np.subtract(each.place, link.place)
    yaw = each.rpy[2]
    if link.turned:
        place, yaw = place * (-1.0, -1.0, 1.0), yaw - math.pi
    rpy = (each.rpy[0], each.rpy[1], yaw)
    angles = "" if not any(rpy) else f' rpy="{" ".join(f"{angle:.16g}" for angle in rpy)}"'
    name = f" name={quoteattr(each.name)}" if tag == "collision" and each.name else ""
    material = f'<material name="{each.colour}"/>' if tag == "visual" else ""
    return (
        f'    <{tag}{name}><origin xyz="{metres(*place)}"{angles}/>'
        f"<geometry>{each.geometry}</geometry>{material}</{tag}>"
    )


def link_text(link: Link) -> str:
    """Write a link."""
    lines = [f'  <link name="{link.name}">']
    lines += [shape_text("collision", each, link) for each in link.solids if each.solid]
    lines += [shape_text("visual", each, link) for each in link.solids if each.seen]
    return "\n".join([*lines, "  </link>"])


def joint_text(link: Link, parent: Link) -> str:
    """Write the joint that holds a link."""
    place = np.subtract(link.place, parent.place)
    if parent.turned:
        place = place * (-1.0, -1.0, 1.0)
    yaw = math.pi if link.turned and not parent.turned else 0.0
    angles = f' rpy="0 0 {yaw:.16g}"' if yaw else ""
    lines = [
        f'  <joint name="{link.joint or link.name + "_mount"}" type="{link.kind}">',
        f'    <parent link="{parent.name}"/><child link="{link.name}"/>',
        f'    <origin xyz="{metres(*place)}"{angles}/>',
    ]
    if link.kind != "fixed":
        low, high = link.limits
        turns = link.kind == "revolute"
        ends = [radians_outward(end) if turns else metres(end) for end in (low, high)]
        speed = "1" if turns else "0.02"
        lines.append(f'    <axis xyz="{" ".join(number(part) for part in link.axis)}"/>')
        lines.append(
            f'    <limit lower="{ends[0]}" upper="{ends[1]}" effort="1" velocity="{speed}"/>'
        )
    return "\n".join([*lines, "  </joint>"])


def urdf_text() -> str:
    """Write the whole URDF."""
    links = [
        *standing(),
        *table_assembly(),
        *arm_assembly("left", -1.0),
        *arm_assembly("right", 1.0),
        *probe_assembly(),
    ]
    by_name = {link.name: link for link in links}
    parts = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        "<!-- Made by tools/make_scene.py; change it there. Metres and radians. -->",
        '<robot name="fiberstation">',
    ]
    for name, rgba in COLOURS.items():
        colour = " ".join(number(part) for part in rgba)
        parts.append(f'  <material name="{name}"><color rgba="{colour}"/></material>')
    for link in links:
        parts.append(link_text(link))
        if link.parent:
            parts.append(joint_text(link, by_name[link.parent]))
    return "\n".join([*parts, "</robot>", ""])


def make_scene() -> None:
    """Write everything."""
    make_meshes()
    (SCENES / "fiberstation.urdf").write_text(urdf_text(), encoding="utf-8")


if __name__ == "__main__":
    argparse.ArgumentParser(description=__doc__).parse_args()
    make_scene()
