"""A curved fibre pushed by a round probe, as a chain of stiff links of least energy.

A third derivation beside those of the twin and of the analysis: no equilibrium is written down.
The fibre is cut into many short links with springs between them, and the shape is sought that
stores the least energy while the probe's edge stands where it stands.
"""

import numpy as np
from scipy.optimize import minimize

Floats = np.ndarray


def arc(length_um: float, turn_deg: float, count: int = 2001) -> Floats:
    """Return an even arc that leaves the jaws along x and turns to +y, shape (count, 2)."""
    at = np.linspace(0.0, 1.0, count)
    turn = np.radians(turn_deg)
    if abs(turn) < 1e-9:
        return np.column_stack([length_um * at, 0.0 * at])
    radius = length_um / turn
    return radius * np.column_stack([np.sin(turn * at), 1.0 - np.cos(turn * at)])


def pushed(
    line_um: Floats,
    *,
    ei_un_um2: float,
    probe_x_um: float,
    radius_um: float,
    travel_um: float,
    depth_um: float = 0.0,
    ei_of=None,
    links: int = 240,
) -> float:
    """Return the force across, uN, on a frictionless probe that pushes towards -y.

    The force is what the stored energy gains over a little more travel.

    Parameters
    ----------
    line_um : ndarray, shape (n, 2)
        The fibre's natural shape from the jaws' tip on, which it leaves along +x.
    ei_of : callable, optional
        Bending stiffness over the length from the jaws' tip, as a part of `ei_un_um2`.
    """
    steps = np.hypot(*np.diff(line_um, axis=0).T)
    whole = np.concatenate([[0.0], np.cumsum(steps)])
    nodes = np.linspace(-depth_um, float(whole[-1]), links + 1)
    x = np.where(nodes < 0.0, nodes, np.interp(nodes, whole, line_um[:, 0]))
    y = np.where(nodes < 0.0, 0.0, np.interp(nodes, whole, line_um[:, 1]))
    lengths = np.hypot(np.diff(x), np.diff(y))
    natural = np.unwrap(np.arctan2(np.diff(y), np.diff(x)))
    # The spring before the first link sits half a link from the clamp.
    apart = np.concatenate([[0.5 * lengths[0]], 0.5 * (lengths[:-1] + lengths[1:])])
    stiff = np.full(links, ei_un_um2) / apart
    if ei_of is not None:
        stiff = stiff * np.array([ei_of(max(each, 0.0)) for each in nodes[:-1]])

    def places(turns: Floats) -> Floats:
        angle = natural + turns
        points = np.column_stack([lengths * np.cos(angle), lengths * np.sin(angle)])
        return np.array([-depth_um, 0.0]) + np.concatenate([[[0.0, 0.0]], np.cumsum(points, 0)])

    def energy(turns: Floats) -> tuple[float, Floats]:
        bends = np.diff(turns, prepend=0.0)
        moments = stiff * bends
        return 0.5 * float(moments @ bends), moments - np.append(moments[1:], 0.0)

    def clearance(turns: Floats, centre: Floats) -> tuple[float, Floats]:
        """Return signed distance of the probe's middle to the chain, less its radius."""
        chain = places(turns)
        start, along = chain[:-1], np.diff(chain, axis=0)
        part = ((centre - start) * along).sum(1) / (along * along).sum(1)
        part = np.clip(part, 0.0, 1.0)
        foot = start + part[:, None] * along
        off = np.hypot(*(centre - foot).T)
        n = int(np.argmin(off))
        tangent = along[n] / np.hypot(*along[n])
        normal = np.array([-tangent[1], tangent[0]])
        height = float(normal @ (centre - foot[n]))
        # A link that turns moves all that follows, and of its own what lies before the foot.
        own = np.column_stack([-along[:, 1], along[:, 0]])[: n + 1]
        own[n] *= part[n]
        slope = np.zeros(links)
        slope[: n + 1] = -(own @ normal)
        return height - radius_um, slope

    # First contact: the lowest place of the probe's middle over its abscissa that is free.
    rest = np.zeros(links)
    low, high = -1e4, 1e4
    for _ in range(60):
        middle = 0.5 * (low + high)
        inside = clearance(rest, np.array([probe_x_um, middle]))[0] < 0.0
        low, high = (middle, high) if inside else (low, middle)
    first_y = 0.5 * (low + high)
    # Turns are scaled so that the search sees numbers near one.
    typical = travel_um / probe_x_um
    scale = ei_un_um2 / (probe_x_um + depth_um) * typical**2
    stored, turns = [], rest
    for travel in (travel_um * 0.98, travel_um * 1.02):
        centre = np.array([probe_x_um, first_y - travel])
        found = minimize(
            lambda u: tuple(
                part * more / scale
                for part, more in zip(energy(u * typical), (1.0, typical), strict=True)
            ),
            turns / typical,
            jac=True,
            method="SLSQP",
            constraints={
                "type": "ineq",
                "fun": lambda u, c=centre: clearance(u * typical, c)[0] / 10.0,
                "jac": lambda u, c=centre: clearance(u * typical, c)[1] * typical / 10.0,
            },
            options={"maxiter": 400, "ftol": 1e-13},
        )
        turns = found.x * typical
        stored.append(energy(turns)[0])
    return (stored[1] - stored[0]) / (0.04 * travel_um)
