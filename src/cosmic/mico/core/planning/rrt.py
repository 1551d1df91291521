"""Search by OMPL's RRTConnect, on edges that the gate has proved; the only file that knows OMPL."""

from typing import Any, Final

from ompl import base, geometric, util
from typing_extensions import override

from cosmic.mico.core.planning.boxes import Boxes
from cosmic.mico.core.planning.space import DIGITS, Place, Space, Way

MOST_LEGS: Final = 24
"""An edge of the tree is not cut into more legs: a way with many stops is slow to drive."""


def search(boxes: Boxes, here: Place, there: Place, seed: int) -> Way | None:
    """Return corners of a way, each edge of which can be driven in clear legs; None if none found.

    OMPL's own validity checks sample an edge and miss thin bodies between two samples; both are
    replaced, so that an edge is in the tree only when the gate has proved it.
    """
    util.setLogLevel(util.LogLevel.LOG_NONE)
    # Seed 0 would be ignored. The generator is one for the process: a search is the only user.
    util.RNG.setSeed(seed % 0x7FFFFFFF + 1)
    grid = _Grid(boxes.space, here, there)
    space = base.RealVectorStateSpace(len(here))
    space.setBounds(grid.bounds())
    info = base.SpaceInformation(space)
    info.setStateValidityChecker(_Free(info, boxes, grid))
    info.setMotionValidator(_Edges(info, boxes, grid))
    info.setup()
    wanted = base.ProblemDefinition(info)
    wanted.setStartAndGoalStates(grid.state(space, here), grid.state(space, there))
    planner = geometric.RRTConnect(info)
    planner.setProblemDefinition(wanted)
    planner.setup()
    planner.solve(base.PlannerTerminationCondition(lambda: boxes.effort.spent))
    if not wanted.hasExactSolution():
        return None
    states = wanted.getSolutionPath().getStates()
    return tuple(grid.place(state) for state in states[1:])


class _Grid:
    """Between OMPL's states, um of a body, and places, in units of axes and rounded."""

    def __init__(self, space: Space, here: Place, there: Place) -> None:
        self._space = space
        self._ends = {self._rounded(end): end for end in (here, there)}

    def bounds(self) -> Any:
        bounds = base.RealVectorBounds(len(self._space.axes))
        for number, weight in enumerate(self._space.weights):
            bounds.setLow(number, weight * self._space.low[number])
            bounds.setHigh(number, weight * self._space.high[number])
        return bounds

    def state(self, space: Any, place: Place) -> Any:
        state = space.allocState()
        for number, weight in enumerate(self._space.weights):
            state[number] = weight * place[number]
        return state

    def place(self, state: Any) -> Place:
        raw = tuple(state[number] / weight for number, weight in enumerate(self._space.weights))
        place = self._rounded(raw)
        return self._ends.get(place) or self._space.clipped(place)

    @staticmethod
    def _rounded(place: Place) -> Place:
        return tuple(round(value, DIGITS) for value in place)


class _Free(base.StateValidityChecker):  # type: ignore[misc]
    def __init__(self, info: Any, boxes: Boxes, grid: _Grid) -> None:
        super().__init__(info)
        self._boxes, self._grid = boxes, grid

    @override
    def isValid(self, state: Any) -> bool:
        return self._boxes.free(self._grid.place(state))


class _Edges(base.MotionValidator):  # type: ignore[misc]
    def __init__(self, info: Any, boxes: Boxes, grid: _Grid) -> None:
        super().__init__(info)
        self._boxes, self._grid = boxes, grid

    @override
    def checkMotion(self, one: Any, other: Any) -> bool:
        here, there = self._grid.place(one), self._grid.place(other)
        return here == there or self._boxes.edge(here, there, MOST_LEGS) is not None
