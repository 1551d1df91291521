"""`PathPlanner`: asks for a detour in a process of its own (ECM, thesis 3.4.2)."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

from cosmic.frame.errors import refusal
from cosmic.frame.verdict import MoveVerdict, Reason, refuse
from cosmic.mico.core.collision.helper_link import GateProcess, NoAnswerError
from cosmic.mico.core.collision.model import SceneModel
from cosmic.mico.core.motion.manager import DeviceManager
from cosmic.mico.core.motion.positioner import Confidence, PositionerState
from cosmic.mico.core.planning.problem import NoPath, Plan, Problem, validate
from cosmic.mico.core.planning.timing import duration_s

PLANNER: Final = "cosmic.mico.core.planning.planner:plan_path"
GRACE_S: Final = 5.0
"""How much longer than its budget the planner may take before its process is given up."""


class PathPlanner:
    """Plans paths that the gate holds safe; for threads that may wait.

    It has a process of its own, so that a search never keeps the gate from answering. The
    process is started by the first search.
    """

    def __init__(self, manager: DeviceManager, model: SceneModel) -> None:
        self._manager = manager
        self._model = model
        self._process = GateProcess(model, handlers={"plan": PLANNER})
        self._started = False

    def plan_path(self, targets: Mapping[str, float], budget_s: float) -> Plan:
        """Return a path of the axes named to `targets`, in gate coordinates.

        Raises
        ------
        UnknownAxisError
            One axis does not exist.
        MoveRefused
            There is no path, or none was found in `budget_s` of wall time; the verdict says what
            blocks.
        """
        problem = self._problem(targets, budget_s)
        validate(self._model, problem)
        try:
            if not self._started or not self._process.alive:
                self._process.start()
                self._started = True
            answer = self._process.ask("plan", problem, budget_s + GRACE_S)
        except NoAnswerError as exc:
            text = f"no path was planned: the planner gave no answer ({exc}); try again"
            raise refusal(refuse(Reason.NO_ANSWER, text)) from exc
        if isinstance(answer, NoPath):
            raise refusal(_no_path(answer))
        if not isinstance(answer, Plan):
            raise refusal(refuse(Reason.NO_ANSWER, "the answer of the planner is invalid"))
        return self._timed(answer)

    def close(self) -> None:
        """End the process; harmless the second time."""
        self._process.close()

    def _timed(self, found: Plan) -> Plan:
        defaults = self._manager.settings.defaults
        hertz = defaults.closed_loop_frequency_hz
        steps = {"um": defaults.nominal_step_um, "deg": defaults.nominal_step_deg}
        rises = {"um": defaults.acceleration_um_s2, "deg": defaults.acceleration_deg_s2}
        units = {name: self._manager.state(name).unit for name in found.start}
        # Each axis is driven by itself: the controllers of this platform keep no phase.
        took_s = duration_s(
            found,
            {name: hertz * steps[unit] for name, unit in units.items()},
            {name: rises[unit] for name, unit in units.items()},
            in_phase=False,
        )
        return replace(found, duration_s=took_s)

    def _problem(self, targets: Mapping[str, float], budget_s: float) -> Problem:
        states = {name: self._manager.state(name) for name in targets}
        for name in self._companions(targets):
            state = self._manager.state(name)
            if _can_help(state):
                states.setdefault(name, state)
        start = {name: _known(state) for name, state in states.items()}
        spans = self._manager.gate.spans()
        return Problem(
            start=start,
            goal={**start, **targets},
            limits={name: _limits(state) for name, state in states.items()},
            others={name: span for name, span in spans.items() if name not in states},
            budget_s=budget_s,
        )

    def _companions(self, targets: Mapping[str, float]) -> set[str]:
        """Return the axes that carry the same bodies: a path may use them, and brings them back."""
        carried = {axis: self._model.carried(axis) for axis in self._model.axes}
        return {
            axis
            for axis, bodies in carried.items()
            if any(bodies & carried.get(target, frozenset()) for target in targets)
        }


def _can_help(state: PositionerState) -> bool:
    """Return True for an axis that may be moved aside and back: known, and inside its limits."""
    if state.limits is None or state.position is None:
        return False
    low, high = state.limits
    return state.confidence is Confidence.KNOWN and low <= state.position <= high


def _known(state: PositionerState) -> float:
    if state.position is None or state.confidence is not Confidence.KNOWN:
        text = f"{state.name}: no path can be planned from an unknown position; initialise first"
        raise refusal(refuse(Reason.POSITION_UNKNOWN, text, axis=state.name))
    return state.position


def _limits(state: PositionerState) -> tuple[float, float]:
    if state.limits is None:
        text = f"{state.name}: paths are planned for axes with a sensor only"
        raise refusal(refuse(Reason.WRONG_KIND, text, axis=state.name))
    return state.limits


def _no_path(answer: NoPath) -> MoveVerdict:
    blocking = answer.blocking
    if blocking is None:
        return refuse(Reason.COLLISION, answer.text)
    return MoveVerdict(
        allowed=False,
        reason=Reason.COLLISION,
        bodies=blocking.bodies,
        place_um=blocking.place_um,
        clearance_um=blocking.distance_um,
        pose=tuple(blocking.pose.items()),
        text=answer.text,
    )
