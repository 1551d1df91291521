"""Which bodies of the platform run into each other, found by the twin's own geometry.

Written apart from the collision gate, to score it: bodies are convex and only slide, so for each
pair the set of positions where they overlap is a polytope that is computed once.
"""

import math
from collections.abc import Iterator, Mapping
from operator import sub
from pathlib import Path
from typing import Final

import numpy as np
import numpy.typing as npt

from cosmic.frame.arrays import Floats
from cosmic.twin.kinematics import Skeleton, Slide
from cosmic.twin.offsets import ToolOffsets
from cosmic.twin.optics.solids import read_solids
from cosmic.twin.settings import TwinSettings
from cosmic.twin.surroundings import Record

PLATE_HALF_UM: Final = 12_000.0

FINEST_UM: Final = 20.0
"""Bodies that touch are not followed more closely than this."""

CHECK_S: Final = 0.005
"""So often bodies are compared while something moves."""

Faces = tuple[Floats, Floats]
Numbers = npt.NDArray[np.intp]


class Contacts:
    """Watches for contact; asked at each look of the workplace.

    Parameters
    ----------
    record : callable
        Told "contact" when two bodies meet and "contact over" when they have parted, with the
        names of both, the greatest depth, and whether it was meant: jaws land on the plate, not
        on what stands there, and the probe feels for a jaw.

    Raises
    ------
    ConfigError
        The URDF or a mesh is missing or broken.
    """

    def __init__(
        self, settings: TwinSettings, folder: Path, skeleton: Skeleton, record: Record
    ) -> None:
        self._settings = settings
        self._skeleton = skeleton
        self._record = record
        self._plate = settings.geometry.plate
        self._stage_names = tuple(settings.stages)
        self._jaws = {jaw for each in settings.geometry.grippers.values() for jaw in each.jaws}
        self._links: list[str] = []
        self._slides: list[Slide] = []
        self._corners: list[Floats] = []
        self._boxes: list[tuple[str, Floats]] = []
        self._still = dict.fromkeys(self._stage_names, 0.0)
        self._read(folder / settings.geometry.urdf)
        self._low = np.array([each.min(axis=0) for each in self._corners])
        self._high = np.array([each.max(axis=0) for each in self._corners])
        self._stages = sorted({name for slide in self._slides for name, _ in slide.directions})
        self._origins = np.array([slide.origin for slide in self._slides])
        self._travels = np.array([self._travel_of(slide) for slide in self._slides])
        self._all_travels = self._travels.reshape(-1, len(self._stages))
        self._steepest = float(np.abs(self._travels).max(initial=0.0))
        self._moving = [n for n, slide in enumerate(self._slides) if slide.directions]
        # What does not move is of no tool, the first.
        names = [each.partition("_")[0] if s.directions else "" for each, s in self._bodies()]
        self._tools = ("", *sorted(set(names) - {""}))
        self._tool_of = np.array([self._tools.index(name) for name in names])
        travels = [settings.kinds[settings.stages[name].kind] for name in self._stages]
        ends = np.array([[kind.low, kind.high] for kind in travels])
        swept = self._travels[:, :, :, None] * ends[None, None, :, :]
        self._lowest = self._origins + self._low + swept.min(axis=3).sum(axis=2)
        self._highest = self._origins + self._high + swept.max(axis=3).sum(axis=2)
        self._first, self._second = self._pairs()
        self._top_um = self._highest_um()
        corner = math.sqrt(2.0) * PLATE_HALF_UM
        self._above_plate = [
            number
            for number in self._moving
            if (self._lowest[number, :2] < corner).all()
            and (self._highest[number, :2] > -corner).all()
            and self._lowest[number, 2] < self._top_um
        ]
        self._looked_at = np.full_like(self._origins, math.inf)
        self._placed_with: tuple[float, ...] = ()
        self._placed_s = self._nearer_um = 0.0
        self._slack_um = 0.0
        self._faces: dict[tuple[int, int], Faces] = {}
        self._now: dict[tuple[str, str], float] = {}
        self._by_design: frozenset[tuple[str, str]] | None = None
        self._next_s = 0.0

    def look(self, values: Mapping[str, float], time_s: float, offsets: ToolOffsets) -> float:
        """Compare all bodies where needed, and return how far the nearest may still go, um."""
        near = self._near_by(values, time_s, offsets)
        if near is not None and (
            self._slack_um > near or (self._by_design is not None and time_s < self._next_s)
        ):
            return max(self._slack_um - near, FINEST_UM)
        placed = tuple([values[name] for name in self._stages])
        positions = self._origins + (self._all_travels @ placed).reshape(-1, 3)
        if not offsets.still:
            shifts = [offsets.at(tool, time_s) for tool in self._tools]
            positions += np.array(shifts)[self._tool_of]
        gone = 2.0 * float(np.maximum.reduce(np.abs(positions - self._looked_at), axis=None))
        bent = offsets.fastest_um_s is None
        self._placed_with = () if bent else placed
        self._placed_s, self._nearer_um = time_s, gone
        if self._slack_um > gone or (self._by_design is not None and time_s < self._next_s):
            return max(self._slack_um - gone, FINEST_UM)
        self._next_s = time_s + CHECK_S
        self._looked_at, self._nearer_um = positions, 0.0
        depths = self._depths(values, positions)
        if self._by_design is None:
            self._by_design = frozenset(depths)
        for pair, depth in depths.items():
            if pair in self._by_design:
                continue
            if pair not in self._now:
                self._record("contact", bodies=pair, depth_um=round(depth, 3))
            self._now[pair] = max(self._now.get(pair, 0.0), depth)
        for pair in [each for each in self._now if each not in depths]:
            self._over(pair)
        return max(self._slack_um, FINEST_UM)

    def _near_by(
        self, values: Mapping[str, float], time_s: float, offsets: ToolOffsets
    ) -> float | None:
        """Return by how much bodies came nearer at most since they were compared; None: unknown.

        No stage carries a body farther than it goes; this takes a tenth of the time of asking
        each body.
        """
        drifts_um_s = offsets.fastest_um_s
        if drifts_um_s is None or not self._placed_with:
            return None
        placed = [values[name] for name in self._stages]
        gone: float = sum(map(abs, map(sub, placed, self._placed_with)))
        since = self._steepest * gone + drifts_um_s * (time_s - self._placed_s)
        return self._nearer_um + 2.0 * since

    def finish(self) -> None:
        """Tell of contacts that still last."""
        for pair in list(self._now):
            self._over(pair)

    def _over(self, pair: tuple[str, str]) -> None:
        depth = self._now.pop(pair)
        jaw, handling = bool(self._jaws & set(pair)), self._settings.handling
        landed = jaw and self._plate in pair and depth <= handling.landing_um
        felt = jaw and self._settings.geometry.probe in pair and depth <= handling.touch_um
        meant = landed or felt
        self._record("contact over", bodies=pair, depth_um=depth, meant=meant)

    # ------------------------------------------------------------------ bodies

    def _read(self, path: Path) -> None:
        skeleton = self._skeleton
        turning, still = skeleton.turning, self._still
        from_world = np.linalg.inv(skeleton.pose(self._plate, still))
        solids = read_solids(path, ())
        bottom = min(float(each[:, 2].min()) for each in solids[self._plate])
        for link, parts in solids.items():
            if skeleton.is_firm_on(link, self._plate):
                pose = from_world @ skeleton.pose(link, still)
                for part in parts:
                    placed = part @ pose[:3, :3].T + pose[:3, 3]
                    box = np.array([placed.min(axis=0), placed.max(axis=0)])
                    # Nothing leaves what stands on the plate through the plate.
                    box[0, 2] = min(box[0, 2], bottom)
                    self._boxes.append((link, box))
            elif link not in turning:
                fixed = skeleton.fixed(link)
                slide = Slide((0.0, 0.0, 0.0), ()) if fixed else skeleton.slide(link)
                turn = np.eye(3) if fixed else skeleton.turn(link)
                self._links += [link] * len(parts)
                self._slides += [slide] * len(parts)
                self._corners += [part @ turn.T for part in parts]

    def _bodies(self) -> Iterator[tuple[str, Slide]]:
        return zip(self._links, self._slides, strict=True)

    def _pairs(self) -> tuple[Numbers, Numbers]:
        """Return the numbers of bodies that could ever meet: their travels overlap."""
        found = [
            (one, two)
            for two in range(len(self._links))
            for one in range(two)
            if self._apart(one, two)
        ]
        pairs = np.array(found, dtype=np.intp).reshape(-1, 2)
        return pairs[:, 0], pairs[:, 1]

    def _apart(self, one: int, two: int) -> bool:
        directions = [{stage for stage, _ in self._slides[each].directions} for each in (one, two)]
        if not (directions[0] or directions[1]):
            return False
        names = [self._links[each].partition("_")[0] for each in (one, two)]
        if names[0] == names[1]:
            return False
        low, high = self._lowest, self._highest
        return bool((low[one] < high[two]).all() and (low[two] < high[one]).all())

    def _travel_of(self, slide: Slide) -> Floats:
        """Return how a body goes with each stage, shape (3, stages)."""
        direction = np.zeros((3, len(self._stages)))
        for name, each in slide.directions:
            direction[:, self._stages.index(name)] += each
        return direction

    # ------------------------------------------------------------------ depth

    def _depths(
        self, values: Mapping[str, float], positions: Floats
    ) -> dict[tuple[str, str], float]:
        low, high = self._low + positions, self._high + positions
        first, second = self._first, self._second
        gaps = np.maximum(low[first] - high[second], low[second] - high[first])
        aparts = np.maximum.reduce(gaps, axis=1).tolist()
        self._slack_um = min(aparts, default=math.inf)
        found: dict[tuple[str, str], float] = {}
        for pair, apart in enumerate(aparts):
            if apart >= 0.0:
                continue
            one, two = int(first[pair]), int(second[pair])
            normals, reach = self._overlap(one, two)
            depths = reach - normals @ (positions[two] - positions[one])
            depth = float(np.minimum.reduce(depths))
            self._keep(found, (self._links[one], self._links[two]), depth)
        self._on_plate(found, values, positions, low)
        return found

    def _keep(
        self, found: dict[tuple[str, str], float], pair: tuple[str, str], depth: float
    ) -> None:
        if depth > 0.0:
            found[pair] = max(found.get(pair, 0.0), depth)

    def _overlap(self, one: int, two: int) -> Faces:
        """Return the faces of the set of ways from body one to body two at which they overlap."""
        if (one, two) not in self._faces:
            # Imported here: it takes time, and only who scores a run needs it.
            from scipy.spatial import ConvexHull

            directions = self._corners[one][:, None, :] - self._corners[two][None, :, :]
            faces = np.unique(ConvexHull(directions.reshape(-1, 3)).equations.round(9), axis=0)
            self._faces[one, two] = faces[:, :3], -faces[:, 3]
        return self._faces[one, two]

    def _highest_um(self) -> float:
        """Return the height of the highest thing on the plate."""
        position = float(self._skeleton.pose(self._plate, self._still)[2, 3])
        return max(float(box[1, 2]) for _, box in self._boxes) + position

    def _on_plate(
        self,
        found: dict[tuple[str, str], float],
        values: Mapping[str, float],
        positions: Floats,
        low: Floats,
    ) -> None:
        """Add what stands in the plate, or in what stands on it: corners of one in the other."""
        aboves = (low[self._above_plate, 2] - self._top_um).tolist()
        nearest = min(aboves, default=math.inf)
        self._slack_um = min(self._slack_um, nearest)
        if nearest >= 0.0:
            return
        plate = self._skeleton.pose(self._plate, values)
        for number, above in zip(self._above_plate, aboves, strict=True):
            if above >= 0.0:
                continue
            corners = (self._corners[number] + positions[number] - plate[:3, 3]) @ plate[:3, :3]
            for link, box in self._boxes:
                inside = np.minimum(corners - box[0], box[1] - corners)
                depth = float(np.maximum.reduce(np.minimum.reduce(inside, axis=1)))
                self._keep(found, (link, self._links[number]), depth)
