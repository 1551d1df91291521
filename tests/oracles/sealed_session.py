"""Raw spans of a session whose truth is sealed, without images: a rod marched from its contact.

A generator of measurements that knows nothing of the analysis, nor of the twin. For a load and a
length the rod is marched from the contact, where nothing bends it, back to the clamp, and the whole
is then turned so that it leaves the clamp as it must: nothing is sought but the length that brings
the probe to where it stands. Clamp, probe and sensor give way, the fibre relaxes, yields, is weak
in places and shears; the instrument has a wrong scale, drifts and plays. The probe rubs: as long as
friction can hold it, it goes along with the place of the fibre that it touches.

A fibre's true stiffness is the flexural rigidity averaged over its longest span as compliance
weighs it, one second after a step.

Run as a program it answers requests on standard input, and tells the truth last of all: so
`cosmic blind-trial` measures in a session that it cannot look into.
"""

import hashlib
import json
import math
import secrets
import sys
from dataclasses import dataclass, field, replace

import numpy as np

Floats = np.ndarray

STEPS = 48
SUBSTEPS = 6
LOADS = 14
LENGTHS = 13
HEAVIEST = 1.1
BLEND_PART = 0.08


@dataclass(frozen=True)
class World:
    """Spreads to draw from; each effect is off by default, and what is left is an ideal rig."""

    name: str = "still"
    # The force sensor, drawn once a session.
    gain: float = 0.0
    gain_drift: float = 0.0
    crosstalk: float = 0.0
    hysteresis: float = 0.0
    noise_un: float = 0.03
    walk_un_sqrt_s: float = 0.005
    spring: float = 0.0
    range_un: float = 180.0
    # The probe and the stage.
    contact_um: float = 0.0
    repeat_um: float = 0.1
    probe_side_un_um: float = 1e6
    reversal_um: float = 0.0
    scale: float = 0.0
    way_um: float = 0.03
    touch_um: float = 0.2
    moved: float = 0.0
    moved_um: float = 40.0
    # The fibre, drawn once a fibre.
    stiffness: tuple = ((1.0, 5e7, 0.5),)
    ei_cv: float = 0.0
    ei_length_um: float = 150.0
    hinges_mm: float = 0.0
    hinge_part: tuple = (0.3, 0.8)
    hinge_um: tuple = (5.0, 30.0)
    weak: float = 0.0
    trend: float = 0.0
    arc_deg: tuple | None = None
    image_deg: float = 0.0
    relaxation: tuple = (0.0, 0.0)
    yield_strain: tuple | None = None
    set_part: float = 0.3
    thickness_um: tuple = (12.0, 0.2)
    shear: float = 0.0
    friction: tuple = (0.0, 0.0)
    slides: bool = False  # at once, whatever friction could hold
    adhesion_un: float = 0.0
    clamp: tuple = ("normal", 10.0, 0.0)
    turn: float = 0.0
    jaw_un_um: tuple | None = None
    slip: float = 0.0
    slip_um: tuple = (2.0, 6.0)
    not_fibre: float = 0.0
    free_um: tuple = (1100.0, 0.25)
    # The standard.
    standard: bool = True
    standard_part: float = 0.01
    dwell_s: float = 2.0


@dataclass
class Session:
    """One draw of the instrument: what stays the same from fibre to fibre."""

    world: World
    rng: np.random.Generator
    gain: float = field(init=False)
    time_s: float = field(default=0.0, init=False)

    def __post_init__(self) -> None:
        world, rng = self.world, self.rng
        self.gain = 1.0 + world.gain * rng.standard_normal()
        self.gain_slope = world.gain_drift * rng.standard_normal()
        self.crosstalk = world.crosstalk * rng.standard_normal()
        self.contact_um = world.contact_um * rng.standard_normal()
        self.spring_un_um = 800.0 * np.exp(world.spring * rng.standard_normal())
        self.scale = 1.0 + world.scale * rng.standard_normal()
        self.friction = rng.uniform(*world.friction)
        self.jaw_un_um = 1e7
        if world.jaw_un_um is not None:
            middle, spread = world.jaw_un_um
            self.jaw_un_um = middle * np.exp(spread * rng.standard_normal())
        self.level_un = 0.4
        self.standard_true = 6e7 * (1.0 + world.standard_part * rng.standard_normal())

    def gain_at(self, part: float) -> float:
        """Return the sensor's scale at a part of the session."""
        return self.gain * (1.0 + self.gain_slope * part)


STANDARD_EI = 6e7
"""What the standard's certificate says, uN um2."""


@dataclass
class Fibre:
    """One draw of a fibre in the jaws."""

    ei: float
    depth_um: float
    turn_deg: float
    friction: float
    relaxation: float
    thickness_um: float
    yield_strain: float
    shear: float
    free_um: float
    nodes_um: Floats
    log_ei: Floats
    shown_deg: float = 0.0
    held_y_um: float = 100.0
    turn_part: float = 0.0
    slips_in: int = -1
    moves_in: int = -1
    is_fibre: bool = True
    hinged: bool = False
    set_seen: float = 0.0
    slipped: bool = False

    @classmethod
    def drawn(cls, session: Session) -> "Fibre":
        world, rng = session.world, session.rng
        parts = np.array([each[0] for each in world.stiffness])
        _, middle, spread = world.stiffness[rng.choice(len(parts), p=parts / parts.sum())]
        kind, where, wide = world.clamp
        if kind == "normal":
            depth = max(0.0, where + wide * rng.standard_normal())
        else:
            depth = where * np.exp(wide * rng.standard_normal())
        turn = 0.0
        if world.arc_deg is not None:
            turn = rng.choice([-1, 1]) * world.arc_deg[0]
            turn *= np.exp(world.arc_deg[1] * rng.standard_normal())
        nodes = np.arange(-300.0, 1400.0, 4.0)
        log_ei = _along(world, rng, nodes)
        hinged = False
        for _ in range(rng.poisson(world.hinges_mm * 0.8)):
            log_ei = _weakened(
                log_ei,
                nodes,
                at=rng.uniform(20.0, 800.0),
                wide=rng.uniform(*world.hinge_um),
                part=rng.uniform(*world.hinge_part),
            )
            hinged = True
        if rng.uniform() < world.weak:
            at, wide = rng.uniform(150.0, 300.0), 30.0
            log_ei = _weakened(log_ei, nodes, at=at, wide=wide, part=0.06)
            hinged = True
        log_ei = log_ei + world.trend * rng.standard_normal() * nodes / 1000.0
        thick, thick_spread = world.thickness_um
        yields = np.inf
        if world.yield_strain is not None:
            yields = world.yield_strain[0] * np.exp(world.yield_strain[1] * rng.standard_normal())
        free, free_spread = world.free_um
        return cls(
            ei=middle * np.exp(spread * rng.standard_normal()),
            depth_um=depth,
            turn_deg=float(np.clip(turn, -85.0, 85.0)),
            friction=session.friction * np.exp(0.1 * rng.standard_normal()),
            relaxation=max(0.0, world.relaxation[0] + world.relaxation[1] * rng.standard_normal()),
            thickness_um=thick * np.exp(thick_spread * rng.standard_normal()),
            yield_strain=yields,
            shear=world.shear,
            free_um=free * np.exp(free_spread * rng.standard_normal()),
            nodes_um=nodes,
            log_ei=log_ei,
            shown_deg=world.image_deg * rng.standard_normal(),
            turn_part=world.turn,
            slips_in=int(rng.integers(5)) if rng.uniform() < world.slip else -1,
            moves_in=int(rng.integers(1, 5)) if rng.uniform() < world.moved else -1,
            is_fibre=not rng.uniform() < world.not_fibre,
            hinged=hinged,
        )

    @classmethod
    def standard(cls, session: Session) -> "Fibre":
        """Return the reference beam: a straight glass fibre."""
        rng = session.rng
        return cls(
            ei=session.standard_true,
            depth_um=abs(8.0 + 3.0 * rng.standard_normal()),
            turn_deg=0.0,
            friction=0.5 * session.friction,
            relaxation=0.0,
            thickness_um=12.0,
            yield_strain=np.inf,
            shear=0.0,
            free_um=1000.0,
            nodes_um=np.array([-300.0, 1400.0]),
            log_ei=np.zeros(2),
        )

    def true_ei(self, span_um: float) -> float:
        """Return the stiffness that compliance sees over a span, uN um2."""
        s = np.linspace(-self.depth_um, span_um, 2000)
        weight = (span_um - s) ** 2
        soft = np.exp(-np.interp(s, self.nodes_um, self.log_ei))
        return float(self.ei * np.trapezoid(weight, s) / np.trapezoid(weight * soft, s))

    def line(self, extra_deg: float = 0.0) -> Floats:
        """Return the natural shape from the jaws' tip on, turned by what the image has wrong."""
        s = np.linspace(0.0, self.free_um, 160)
        heading = np.radians(self.turn_deg) * s / 1300.0 + np.radians(extra_deg)
        step = np.diff(s)
        middle = 0.5 * (heading[1:] + heading[:-1])
        x = np.concatenate([[0.0], np.cumsum(np.cos(middle) * step)])
        y = np.concatenate([[0.0], np.cumsum(np.sin(middle) * step)])
        return np.column_stack([x, y])


def _weakened(log_ei: Floats, nodes: Floats, *, at: float, wide: float, part: float) -> Floats:
    return log_ei + np.log(part) * (np.abs(nodes - at) < wide / 2.0)


def _along(world: World, rng: np.random.Generator, nodes: Floats) -> Floats:
    if not world.ei_cv:
        return np.zeros_like(nodes)
    coarse = nodes[::5]
    apart = np.abs(coarse[:, None] - coarse[None, :])
    shape = np.exp(-apart / world.ei_length_um) + 1e-9 * np.eye(len(coarse))
    drawn = np.linalg.cholesky(shape) @ rng.standard_normal(len(coarse))
    sigma = np.sqrt(np.log1p(world.ei_cv**2))
    return np.asarray(np.interp(nodes, coarse, sigma * drawn))


@dataclass
class Balance:
    """Equilibria, each (places, friction, loads): with friction one way, none, the other way.

    Travel, force across and along, and how far the fibre has slid past the probe. And where the
    probe first touches, (places,).
    """

    travel: Floats
    across: Floats
    along: Floats
    slid: Floats
    touch: Floats


def curves(fibre: Fibre, places_um: Floats, **rig: float) -> tuple[Floats, Floats, Floats, Floats]:
    """Return travel, force across and force along, each (places, out and back, loads).

    Of a probe that slides at once. And where it first touches, (places,).
    """
    found = balance(fibre, places_um, **rig)
    travel, across, along = sliding(found)
    return travel, across, along, found.touch


def sliding(found: Balance) -> list[Floats]:
    """Return travel, force across and force along, out and back, of a probe that slides at once."""
    # Which way the probe rubs on its way out is where the contact wanders along the fibre.
    both = found.slid[..., [0, 2], :].mean(axis=-2)
    wanders = (both - both[..., :1])[..., None, :] < 0.0
    return [
        np.where(wanders, values[..., [2, 0], :], values[..., [0, 2], :])
        for values in (found.travel, found.across, found.along)
    ]


def balance(
    fibre: Fibre,
    places_um: Floats,
    *,
    jaw_un_um: float = 1e7,
    side_un_um: float = 1e6,
    radius_um: float = 25.0,
    spring_un_um: float = 1e9,
) -> Balance:
    """Return what pushes at places come to."""
    shape = (len(places_um), 3, LOADS, LENGTHS)
    length = (places_um + fibre.depth_um)[:, None, None, None]
    load = HEAVIEST * np.linspace(0.0, 1.0, LOADS) ** 1.3
    normal = np.broadcast_to(load[None, None, :, None] * fibre.ei / length**2, shape)
    sign = np.array([1.0, 0.0, -1.0])[None, :, None, None]
    rub = np.broadcast_to(fibre.friction * sign, shape)
    line = fibre.line()
    arcs = np.linspace(0.0, fibre.free_um, len(line))
    natural = np.interp(places_um, line[:, 0], arcs)
    slack = np.linspace(-0.10, 0.16, LENGTHS)[None, None, None, :]
    ends = np.broadcast_to(
        natural[:, None, None, None] + slack * places_um[:, None, None, None], shape
    ).ravel()
    force_y, force_x = -normal.ravel(), (rub * normal).ravel()
    x, y, h = np.zeros_like(ends), np.zeros_like(ends), np.zeros_like(ends)
    step = (ends + fibre.depth_um) / STEPS
    bow = np.radians(fibre.turn_deg) / 1300.0

    def bent(s: Floats, x: Floats, y: Floats) -> Floats:
        moment = -x * force_y + y * force_x
        return -moment * np.exp(-np.interp(s, fibre.nodes_um, fibre.log_ei)) / fibre.ei

    def natural_from(s: Floats) -> Floats:
        return bow * (np.maximum(s, 0.0) - np.maximum(ends, 0.0))

    for number in range(STEPS):
        s = ends - number * step
        here = h + natural_from(s)
        middle = s - 0.5 * step
        half = h + 0.5 * step * bent(s, x, y) + natural_from(middle)
        turned = bent(middle, x - 0.5 * step * np.cos(here), y - 0.5 * step * np.sin(here))
        x, y = x - step * np.cos(half), y - step * np.sin(half)
        h = h + step * turned
    h = h + natural_from(np.full_like(ends, -fibre.depth_um))
    moment = -x * force_y + y * force_x
    turn_un_um = fibre.turn_part / fibre.ei
    contact = -h + turn_un_um * moment
    cos, sin = np.cos(contact), np.sin(contact)
    across = -(sin * force_x + cos * force_y)
    along = cos * force_x - sin * force_y
    at_x = -fibre.depth_um - cos * x + sin * y - radius_um * sin
    at_y = -sin * x - cos * y + radius_um * cos - across / jaw_un_um
    # The rod shears: so much more travel, in proportion to force and length.
    at_y -= across * fibre.shear * fibre.thickness_um**2 * (ends + fibre.depth_um) / (10 * fibre.ei)
    wanted = np.broadcast_to(places_um[:, None, None, None], shape) - (along / side_un_um).reshape(
        shape
    )
    found = [np.empty(shape[:3]) for _ in range(4)]
    slid = ends - radius_um * contact
    for index in np.ndindex(shape[:3]):
        xs = at_x.reshape(shape)[index]
        off = xs - wanted[index]
        for values, into in zip((at_y, across, along, slid), found, strict=True):
            into[index] = np.interp(0.0, off, values.reshape(shape)[index])
    tip_y, across, along, slid = found
    travel = tip_y[:, :, :1] - tip_y + across / spring_un_um
    return Balance(travel, across, along, slid, tip_y[:, 0, 0])


@dataclass
class Push:
    """What a staircase out and back read, in the plainest form."""

    place_um: float
    way_um: Floats
    force_un: Floats
    std_un: Floats
    time_s: Floats
    loading: np.ndarray


def pushes(
    session: Session, fibre: Fibre, plan: list[tuple[float, float]], *, first: int = 0
) -> list[Push]:
    """Return what the rig reads of pushes at (place, stroke), one after the other."""
    rng, world = session.rng, session.world
    true = np.array([place * session.scale + session.contact_um for place, _ in plan])
    true = true + world.repeat_um * rng.standard_normal(len(plan))
    for number in range(len(plan)):
        if number + first == fibre.moves_in:
            true[number] += rng.choice([-1, 1]) * world.moved_um
    true = np.maximum(true, 20.0)
    found = balance(
        fibre,
        true,
        jaw_un_um=session.jaw_un_um,
        side_un_um=world.probe_side_un_um,
        spring_un_um=session.spring_un_um,
    )
    return [
        _push(
            session,
            fibre,
            plan[n],
            number=n + first,
            at=Balance(*(values[n] for values in vars(found).values())),
            hinge_um=fibre.held_y_um - found.touch[n] + world.touch_um * rng.standard_normal(),
        )
        for n in range(len(plan))
    ]


def rubbed(at: Balance, press: Floats) -> tuple[Floats, Floats]:
    """Return forces across and along while the probe goes from travel to travel.

    The contact stays where it is on the fibre as long as friction can hold it there.
    """
    steps = np.linspace(press[:-1], press[1:], SUBSTEPS + 1)[1:].T.ravel()
    fine = np.concatenate([press[:1], steps])
    slid, across, along = (
        np.array([np.interp(fine, at.travel[n], values[n]) for n in range(3)])
        for values in (at.slid, at.across, at.along)
    )

    def mixed(values: Floats, part: Floats) -> Floats:
        return values[1] + part * (
            0.5 * (values[0] - values[2]) + part * (0.5 * (values[0] + values[2]) - values[1])
        )

    parts, stays = np.zeros(len(fine)), at.slid[1, 0]
    for n, travel in enumerate(fine):
        if travel <= 0.0:
            stays = at.slid[1, 0]
            continue
        ahead, none, back = slid[:, n].tolist()
        slope, bend, left = 0.5 * (ahead - back), 0.5 * (ahead + back) - none, stays - none
        root = slope + math.copysign(math.sqrt(max(slope**2 + 4.0 * bend * left, 0.0)), slope)
        parts[n] = min(max(2.0 * left / root, -1.0), 1.0) if root else 0.0
        stays = mixed(slid[:, n], parts[n])
    free = fine > 0.0
    each = slice(None, None, SUBSTEPS)
    return (free * mixed(across, parts))[each], (free * mixed(along, parts))[each]


def slid_at_once(at: Balance, press: Floats, loading: Floats) -> tuple[Floats, Floats]:
    """Return the same of a probe that slides at once, and turns round over a part of the way."""
    travel, *forces = sliding(at)
    gone = np.where(loading, 0.0, np.maximum(press.max() - press, 0.0)) / press.max()
    stays = np.exp(-gone / BLEND_PART)

    def felt(values: Floats) -> Floats:
        out, back = (np.interp(press, travel[n], values[n], left=0.0) for n in range(2))
        return stays * out + (1.0 - stays) * back

    across, along = (felt(values) for values in forces)
    return across, along


def _push(
    session: Session, fibre: Fibre, plan, *, number: int, at: Balance, hinge_um: float
) -> Push:
    world, rng = session.world, session.rng
    place, stroke = plan
    if not fibre.is_fibre:  # something that stands on the plate: as stiff wherever it is pushed
        at = replace(at, across=0.8 * at.travel)
    free = np.array([-12.0, -6.0, -3.0]) * min(1.0, stroke / 10.0)
    out = np.concatenate([free, np.linspace(0.02, 1.0, 10) * stroke])
    dwell = np.full(6 if world.dwell_s else 0, stroke)
    back = np.concatenate([np.linspace(1.0, -0.2, 9)[1:] * stroke, [-14.0]])
    way = np.concatenate([out, dwell, back])
    loading = np.arange(len(way)) < len(out) + len(dwell)
    pause = np.full(len(way), 0.11)
    if len(dwell):
        pause[len(out) : len(out) + len(dwell)] = world.dwell_s / len(dwell)
    time = session.time_s + np.cumsum(pause)
    session.time_s = float(time[-1]) + 1.5
    real = way + world.way_um * rng.standard_normal(len(way))
    real = real - world.reversal_um * ~loading
    # Fibre slips in the jaws at some point of the way out, for good.
    slip = np.zeros(len(way))
    if number == fibre.slips_in:
        begins = int(rng.integers(len(free) + 4, len(out)))
        size = min(rng.uniform(*world.slip_um), 0.4 * stroke)
        slip[begins:] = size
        fibre.slipped = True
    # What yields stays bent.
    strain = 1.5 * fibre.thickness_um * np.maximum(real, 0.0) / (place + fibre.depth_um) ** 2
    over = np.maximum(np.maximum.accumulate(strain) - fibre.yield_strain, 0.0)
    bent = world.set_part * over / np.maximum(strain.max(), 1e-9) * stroke
    fibre.set_seen = max(fibre.set_seen, float(bent[-1]))
    press = real - slip - bent
    force, side = slid_at_once(at, press, loading) if world.slides else rubbed(at, press)
    since = time[:, None] - time[None, :]
    held = np.log10(np.maximum(since, 0.0) + 0.05)
    grown = np.diff(force, prepend=0.0)
    relaxed = np.where(since >= 0.0, held * grown[None, :], 0.0).sum(axis=1)
    force = force - fibre.relaxation * relaxed
    peak = max(float(force.max()), 1e-9)
    if world.adhesion_un:
        clinging = (
            ~loading
            & (press <= 0.0)
            & (press > -world.adhesion_un * at.travel[1][1] / max(at.across[1][1], 1e-9))
        )
        force = force - clinging * world.adhesion_un * 0.7
    force = np.where(loading | (press > -20.0), force, 0.0)
    read = session.gain_at(session.time_s / 3600.0) * (force + session.crosstalk * side)
    read = read + world.hysteresis * peak * ~loading * 4.0 * (force / peak) * (1.0 - force / peak)
    walked = np.cumsum(world.walk_un_sqrt_s * np.sqrt(pause) * rng.standard_normal(len(way)))
    level = session.level_un + walked
    session.level_un = float(level[-1]) * 0.9
    read = read + level + world.noise_un * rng.standard_normal(len(way))
    read = np.clip(read, -world.range_un, world.range_un)
    std = np.full(len(way), max(world.noise_un, 0.004))
    return Push(place, hinge_um + way, read, std, time, loading)


FRIENDLY = World(
    "friendly",
    gain=0.01,
    crosstalk=0.005,
    hysteresis=0.001,
    noise_un=0.02,
    walk_un_sqrt_s=0.005,
    spring=0.1,
    contact_um=1.0,
    repeat_um=0.2,
    probe_side_un_um=100.0,
    reversal_um=0.02,
    scale=0.0001,
    ei_cv=0.05,
    ei_length_um=500.0,
    arc_deg=(22.0, 0.3),
    image_deg=0.3,
    relaxation=(0.005, 0.0),
    yield_strain=(0.03, 0.1),
    thickness_um=(12.0, 0.2),
    shear=12.0,
    friction=(0.04, 0.06),
    clamp=("normal", 10.0, 4.0),
    jaw_un_um=(1e4, 0.2),
    slip=0.02,
)
REALISTIC = World(
    "realistic",
    gain=0.03,
    gain_drift=0.003,
    crosstalk=0.02,
    hysteresis=0.003,
    noise_un=0.05,
    walk_un_sqrt_s=0.02,
    spring=0.12,
    contact_um=3.0,
    repeat_um=0.4,
    probe_side_un_um=10.0,
    reversal_um=0.2,
    scale=0.0005,
    stiffness=((0.6, 3e7, 0.5), (0.4, 1.5e8, 0.5)),
    ei_cv=0.15,
    ei_length_um=150.0,
    hinges_mm=0.5,
    trend=0.15,
    arc_deg=(35.0, 0.4),
    image_deg=1.0,
    relaxation=(0.03, 0.01),
    yield_strain=(0.009, 0.3),
    thickness_um=(10.0, 0.3),
    shear=20.0,
    friction=(0.2, 0.4),
    adhesion_un=0.5,
    clamp=("log", 30.0, 0.5),
    jaw_un_um=(1000.0, 0.6),
    slip=0.08,
)
HARSH = replace(
    REALISTIC,
    name="harsh",
    gain=0.06,
    gain_drift=0.01,
    crosstalk=0.05,
    hysteresis=0.01,
    noise_un=0.12,
    walk_un_sqrt_s=0.05,
    contact_um=8.0,
    repeat_um=1.0,
    probe_side_un_um=5.0,
    reversal_um=1.0,
    scale=0.003,
    stiffness=((1.0, 2e7, 1.2),),
    ei_cv=0.30,
    ei_length_um=50.0,
    hinges_mm=1.5,
    hinge_part=(0.3, 0.5),
    trend=0.4,
    arc_deg=(45.0, 0.4),
    image_deg=2.0,
    relaxation=(0.08, 0.02),
    yield_strain=(0.005, 0.4),
    shear=300.0,
    thickness_um=(6.0, 0.3),
    friction=(0.3, 0.6),
    adhesion_un=3.0,
    clamp=("log", 60.0, 0.5),
    jaw_un_um=(200.0, 0.6),
    slip=0.2,
)
WORLDS = {each.name: each for each in (FRIENDLY, REALISTIC, HARSH)}


class Seal:
    """A session that answers one request after the other, and keeps its truth until it is opened.

    What is drawn follows from a secret seed; its hash is given away first, so that whoever
    opens the session later can see that the truth was not chosen afterwards.
    """

    def __init__(self, world: World, fibres: int, seed: int) -> None:
        self.seed = seed
        self.session = Session(world, np.random.default_rng(seed))
        self.fibres = [Fibre.drawn(self.session) for _ in range(fibres)]
        self.longest = [0.0] * fibres
        self.number = -1
        self.taken: Fibre | None = None
        self.pushed = 0

    @property
    def digest(self) -> str:
        """Hash of the secret that everything follows from."""
        return hashlib.sha256(str(self.seed).encode()).hexdigest()

    def take(self, number: int, part: float) -> dict:
        """Hand over what the image shows of a fibre, or of the standard for -1."""
        self.session.time_s = max(self.session.time_s, 3600.0 * part)
        self.number, self.pushed = number, 0
        self.taken = self.fibres[number] if number >= 0 else Fibre.standard(self.session)
        return {"line_um": self.taken.line(self.taken.shown_deg).tolist()}

    def push(self, place_um: float, stroke_um: float) -> dict:
        """Hand over what the rig reads of a push of what was taken."""
        found = pushes(self.session, self.taken, [(place_um, stroke_um)], first=self.pushed)[0]
        self.pushed += 1
        if self.number >= 0:
            self.longest[self.number] = max(self.longest[self.number], place_um)
        return {
            "way_um": found.way_um.tolist(),
            "force_un": found.force_un.tolist(),
            "force_std_un": found.std_un.tolist(),
            "time_s": found.time_s.tolist(),
            "loading": found.loading.tolist(),
        }

    def opened(self) -> dict:
        """Tell the truth."""
        pairs = zip(self.fibres, self.longest, strict=True)
        return {
            "seed": str(self.seed),
            "ei_n_m2": [1e-18 * each.true_ei(span) if span else None for each, span in pairs],
            "gain": self.session.gain,
        }


def serve() -> None:
    """Answer requests, a line of JSON each, until the session is opened."""
    first = json.loads(sys.stdin.readline())
    seed = first.get("seed")
    seed = secrets.randbits(128) if seed is None else int(seed)
    seal = Seal(WORLDS[first["world"]], int(first["fibres"]), seed)
    answer = {
        "seal": seal.digest,
        "standard_ei_n_m2": 1e-18 * STANDARD_EI,
        "standard_expanded_part": 0.02,
        "range_un": seal.session.world.range_un,
    }
    while True:
        sys.stdout.write(json.dumps(answer) + "\n")
        sys.stdout.flush()
        request = json.loads(sys.stdin.readline())
        if "take" in request:
            answer = seal.take(int(request["take"]), float(request["part"]))
        elif "push" in request:
            answer = seal.push(*request["push"])
        else:
            sys.stdout.write(json.dumps(seal.opened() | {"frozen": request["frozen"]}) + "\n")
            return


if __name__ == "__main__":
    serve()
