"""The public names of the scripted API, as the program has them and as its page must list them."""

import inspect
from enum import Enum
from typing import Any, Final

from pydantic import BaseModel

import cosmic
from cosmic.app.stations.remote_station import StationControl
from cosmic.autonomy.bending.plan import PlannedSpan
from cosmic.autonomy.bending.result import (
    BendingError,
    BendingResult,
    Contribution,
    Quality,
    SpanFit,
)
from cosmic.autonomy.bending.span import Span
from cosmic.autonomy.calibrating.registry import (
    CalibrationEntry,
    CalibrationRegistry,
    CalibrationStanding,
)
from cosmic.autonomy.campaign.campaign import Campaign, CampaignPhase
from cosmic.autonomy.campaign.records import CampaignError, FibreRecord, Outcome, Shape
from cosmic.autonomy.campaign.statistics import CampaignProgress, MeanEi
from cosmic.autonomy.campaign.store_read import CampaignReader
from cosmic.autonomy.control.control import Control
from cosmic.autonomy.control.handle import ControlHandle
from cosmic.autonomy.control.law import ControlState
from cosmic.autonomy.control.loop import ControlEnding, ControlReading, ControlStatistics
from cosmic.autonomy.control.pace import PaceStatistics
from cosmic.autonomy.control.pid import PidGains
from cosmic.autonomy.control.trace import ControlTrace
from cosmic.autonomy.procedures.failures import ProcedureAborted, ProcedureStopped, UndoFailed
from cosmic.autonomy.procedures.operation import OperationFailed, UnitOperation
from cosmic.autonomy.procedures.run import ProcedureRun, RunState
from cosmic.autonomy.procedures.times import OperationStatistics, OperationTimes
from cosmic.autonomy.procedures.tree import NodeEvent, NodeState, NodeView
from cosmic.autonomy.shipped.fibre_handling import FibreHandling
from cosmic.autonomy.shipped.single_operation import (
    OperationPreview,
    OperationRequest,
    OperationResult,
    SingleOperation,
)
from cosmic.daqco.api.daqco import Daqco, DaqCounters, DaqLimit
from cosmic.daqco.api.plan_channel import ChannelHandle
from cosmic.daqco.api.recorder import RecordingState
from cosmic.daqco.core.chunk import DataChunk
from cosmic.daqco.core.curves import Slope
from cosmic.daqco.core.recording_format import AxisPosition, Overrun, RecordedEvent
from cosmic.daqco.core.scale import Scale
from cosmic.daqco.core.settings import LimitSettings
from cosmic.frame.declaration import Declared
from cosmic.frame.errors import (
    DeviceFault,
    ExportCancelled,
    OperationCancelled,
    RecordingExistsError,
)
from cosmic.frame.network.errors import (
    Busy,
    CallRefused,
    CommandExpired,
    RemoteDefect,
    StationAway,
    StationTimeout,
)
from cosmic.frame.operation import Operation, Progress, Task
from cosmic.frame.plan_shape import PlanStatus
from cosmic.frame.renamed import Renamed
from cosmic.mico.api.axis import Axis
from cosmic.mico.api.axis_group import AxisGroup
from cosmic.mico.api.collision import Collision
from cosmic.mico.api.group_movement import GroupMovement
from cosmic.mico.api.jogging import Jogging
from cosmic.mico.api.mico import Mico
from cosmic.mico.api.move_status import MoveStatus
from cosmic.mico.api.planned_path import PlannedPath
from cosmic.mico.api.poses import Poses
from cosmic.mico.api.stepwise import StepwiseMove
from cosmic.mico.api.tools import Tool
from cosmic.mico.api.trajectories import Trajectories
from cosmic.mico.api.trajectory_player import TrajectoryPlayer
from cosmic.mico.api.trajectory_recording import TrajectoryRecording
from cosmic.mico.api.trajectory_start import AwayFromStartError
from cosmic.mico.api.trajectory_state import PlayProgress, PlayState
from cosmic.mico.core.collision.answer import Approach
from cosmic.mico.core.motion.links import Link
from cosmic.mico.core.motion.movement import Movement
from cosmic.mico.core.motion.positioner import Confidence, PositionerState, Status
from cosmic.mico.core.motion.undo import UndoEntry
from cosmic.mico.core.poses import Pose
from cosmic.mico.core.teleoperation.state import TeleoperationPhase, TeleoperationState
from cosmic.mico.core.teleoperation.teleoperation import Teleoperation
from cosmic.mico.core.trajectory.model import Trajectory, TrajectoryError
from cosmic.mico.core.trajectory.rehearsal import Rehearsal
from cosmic.mico.hw.input_device import Feedback, InputInfo, InputKind, InputState
from cosmic.mico.hw.interface import Activity, Direction, PositionerKind
from cosmic.vico.api.camera import CameraHandle, Seen
from cosmic.vico.api.coordinate_transform import CalibrationShown, RotationShown
from cosmic.vico.api.fibres import PlacedFibre
from cosmic.vico.api.lens import LensHandle, LightHandle
from cosmic.vico.api.vico import Vico
from cosmic.vico.core.camera_recordings import ImageRecordingState
from cosmic.vico.core.image import CameraImage, Circumstances
from cosmic.vico.core.vision.tool_tips import TipSeen
from cosmic.vico.hw.interface import CameraCounters, CameraRanges, CameraSettings, Frame

CLASSES: Final[dict[str, type]] = {
    "Rig": cosmic.Rig,
    "StationControl": StationControl,
    "Mico": Mico,
    "Collision": Collision,
    "Tool": Tool,
    "Approach": Approach,
    "PlannedPath": PlannedPath,
    "Link": Link,
    "UndoEntry": UndoEntry,
    "Trajectories": Trajectories,
    "TrajectoryRecording": TrajectoryRecording,
    "Trajectory": Trajectory,
    "Rehearsal": Rehearsal,
    "TrajectoryPlayer": TrajectoryPlayer,
    "PlayProgress": PlayProgress,
    "Poses": Poses,
    "Pose": Pose,
    "Axis": Axis,
    "AxisGroup": AxisGroup,
    "MoveStatus": MoveStatus,
    "Movement": Movement,
    "GroupMovement": GroupMovement,
    "Jogging": Jogging,
    "StepwiseMove": StepwiseMove,
    "Teleoperation": Teleoperation,
    "TeleoperationState": TeleoperationState,
    "InputInfo": InputInfo,
    "InputState": InputState,
    "Operation": Operation,
    "Task": Task,
    "Progress": Progress,
    "PositionerState": PositionerState,
    "MoveVerdict": cosmic.MoveVerdict,
    "Daqco": Daqco,
    "ChannelHandle": ChannelHandle,
    "PlanStatus": PlanStatus,
    "RecordingState": RecordingState,
    "DaqCounters": DaqCounters,
    "DaqLimit": DaqLimit,
    "LimitSettings": LimitSettings,
    "Scale": Scale,
    "DataChunk": DataChunk,
    "Recording": cosmic.Recording,
    "Slope": Slope,
    "RecordedEvent": RecordedEvent,
    "Overrun": Overrun,
    "AxisPosition": AxisPosition,
    "Declared": Declared,
    "Vico": Vico,
    "CameraHandle": CameraHandle,
    "LensHandle": LensHandle,
    "LightHandle": LightHandle,
    "PlacedFibre": PlacedFibre,
    "CameraImage": CameraImage,
    "Circumstances": Circumstances,
    "Frame": Frame,
    "CameraSettings": CameraSettings,
    "CameraRanges": CameraRanges,
    "CameraCounters": CameraCounters,
    "Seen": Seen,
    "TipSeen": TipSeen,
    "CalibrationShown": CalibrationShown,
    "RotationShown": RotationShown,
    "ImageRecordingState": ImageRecordingState,
    "Control": Control,
    "ControlHandle": ControlHandle,
    "ControlReading": ControlReading,
    "ControlStatistics": ControlStatistics,
    "PaceStatistics": PaceStatistics,
    "ControlTrace": ControlTrace,
    "PidGains": PidGains,
    "UnitOperation": UnitOperation,
    "ProcedureRun": ProcedureRun,
    "NodeEvent": NodeEvent,
    "NodeView": NodeView,
    "OperationTimes": OperationTimes,
    "OperationStatistics": OperationStatistics,
    "PlannedSpan": PlannedSpan,
    "Span": Span,
    "BendingResult": BendingResult,
    "Contribution": Contribution,
    "SpanFit": SpanFit,
    "Campaign": Campaign,
    "CampaignProgress": CampaignProgress,
    "MeanEi": MeanEi,
    "CampaignReader": CampaignReader,
    "FibreRecord": FibreRecord,
    "Shape": Shape,
    "FibreHandling": FibreHandling,
    "OperationRequest": OperationRequest,
    "OperationPreview": OperationPreview,
    "OperationResult": OperationResult,
    "CalibrationRegistry": CalibrationRegistry,
    "CalibrationEntry": CalibrationEntry,
}
ENUMS: Final[dict[str, type[Enum]]] = {
    "Reason": cosmic.Reason,
    "Status": Status,
    "Confidence": Confidence,
    "Activity": Activity,
    "PositionerKind": PositionerKind,
    "Direction": Direction,
    "PlayState": PlayState,
    "DeviceFault": DeviceFault,
    "TeleoperationPhase": TeleoperationPhase,
    "InputKind": InputKind,
    "Feedback": Feedback,
    "ControlState": ControlState,
    "ControlEnding": ControlEnding,
    "RunState": RunState,
    "CampaignPhase": CampaignPhase,
    "NodeState": NodeState,
    "Quality": Quality,
    "Outcome": Outcome,
    "CalibrationStanding": CalibrationStanding,
    "SingleOperation": SingleOperation,
}
# Exceptions that a script may want to name and that `cosmic` does not export.
FURTHER_EXCEPTIONS: Final = (
    OperationCancelled,
    RecordingExistsError,
    ExportCancelled,
    TrajectoryError,
    AwayFromStartError,
    OperationFailed,
    ProcedureStopped,
    UndoFailed,
    ProcedureAborted,
    BendingError,
    CampaignError,
    StationAway,
    StationTimeout,
    Busy,
    CommandExpired,
    CallRefused,
    RemoteDefect,
)
# Attributes that an object gets when it is made, which the class does not show.
MADE_LATER: Final = {
    "Vico": ("lens", "light"),
    "Campaign": ("work", "recipe", "store"),
    "CampaignReader": ("folder",),
    "CameraHandle": ("name",),
    "Control": ("settings",),
    "ProcedureRun": ("procedure", "work", "times"),
    "Axis": ("commander",),
    "Approach": ("bodies", "distance_um", "places_um", "pose"),
    "Link": ("first", "second", "ratio"),
    "UndoEntry": ("group", "before", "number"),
    "PlannedPath": ("start", "waypoints", "method", "length", "straight_length", "duration_s"),
    "GroupMovement": ("movements",),
    "MoveStatus": ("movement",),
    "DataChunk": ("first_sample", "time_s", "rate_hz", "channels", "volts", "scales"),
    "StepwiseMove": ("planned", "movement"),
}


def names(title: str) -> dict[str, str]:
    """Return the public names of a class with what the first cell of their row must be."""
    cls = CLASSES[title]
    if issubclass(cls, BaseModel):
        return {name: f"`{name}`" for name in cls.model_fields}
    found = {name: getattr(cls, name) for name in dir(cls) if not name.startswith("_")}
    found = {name: each for name, each in found.items() if not isinstance(each, Renamed)}
    if cls is not Declared:  # what all that is declared have is listed once
        found = {
            name: each for name, each in found.items() if getattr(Declared, name, 0) is not each
        }
    if issubclass(cls, Operation) and cls is not Operation:  # what all have is listed once
        found = {
            name: value
            for name, value in found.items()
            if getattr(Operation, name, None) is not value
        }
    found |= dict.fromkeys(MADE_LATER.get(title, ()))
    return {name: f"`{name}{signature(value)}`" for name, value in found.items()}


def signature(value: Any) -> str:
    """Return the parameters of a method as a caller writes them; empty for an attribute."""
    if not (inspect.isfunction(value) or inspect.ismethod(value)):
        return ""
    wanted = inspect.signature(value).parameters.values()
    plain = [each.replace(annotation=each.empty) for each in wanted if each.name != "self"]
    return str(inspect.Signature(plain))


def exceptions() -> dict[str, type[BaseException]]:
    """Return the exceptions that ``cosmic`` exports, and those of recordings."""
    found = {name: getattr(cosmic, name) for name in cosmic.__all__}
    found |= {each.__name__: each for each in FURTHER_EXCEPTIONS}
    return {
        name: value
        for name, value in found.items()
        if isinstance(value, type) and issubclass(value, BaseException)
    }
