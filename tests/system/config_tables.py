"""What the tables of docs/reference/configuration.md must say, taken from the models."""

import json
from collections.abc import Iterator
from typing import Any, Final

from pydantic import BaseModel

from cosmic.app.configuration.alarms import AlarmSettings, FallingLevels, RisingLevels
from cosmic.app.configuration.gateways import EpicsSettings, HttpClient, HttpSettings
from cosmic.app.configuration.network import NetworkSettings
from cosmic.app.configuration.platform_file import PlatformFile, PlatformSettings
from cosmic.autonomy.control.settings import ControlSettings
from cosmic.daqco.core.settings import (
    CameraTriggerSettings,
    ChannelSettings,
    DaqcoSettings,
    DriverSettings,
    LimitSettings,
    OutputSettings,
    ScaleSettings,
)
from cosmic.mico.core.motion.settings import LinkSettings
from cosmic.mico.core.sequence.settings import InitialisationSettings, StepSettings
from cosmic.mico.core.settings import ContactSettings as MicoContactSettings
from cosmic.mico.core.settings import ControllerSettings as MicoControllerSettings
from cosmic.mico.core.settings import (
    GroupSettings,
    JogSettings,
    MicoSettings,
    MotionDefaults,
    PositionerSettings,
    UndoSettings,
    WatchSettings,
)
from cosmic.mico.core.teleoperation.settings import (
    TeleoperationAxisSettings,
    TeleoperationProfileSettings,
    TeleoperationSettings,
)
from cosmic.mico.core.trajectory.settings import MirrorSettings
from cosmic.twin.force_settings import (
    ClimateSettings,
    ContactSettings,
    FibreSettings,
    ForceSensorSettings,
    GeometrySettings,
    GripperGeometry,
    JointDrive,
    PlateSettings,
    StandardSettings,
)
from cosmic.twin.handling_settings import HandlingSettings
from cosmic.twin.lens_settings import LensMotorSettings, LensSettings, LightSettings
from cosmic.twin.optics.settings import (
    ImageSettings,
    OpticsSettings,
    SensorSettings,
    ViewSettings,
)
from cosmic.twin.sample_settings import SampleSettings
from cosmic.twin.settings import (
    ControllerSettings,
    DeviceWiring,
    StageKind,
    StageSettings,
    TwinSettings,
)
from cosmic.vico.core.settings import (
    CameraConfig,
    LampSettings,
    MotorLensSettings,
    VicoSettings,
    ZoomStepSettings,
)
from cosmic.vico.core.tool_settings import ToolSettings

# Heading in the page, and the model whose keys its table lists.
SECTIONS: Final[dict[str, type[BaseModel]]] = {
    "[platform]": PlatformSettings,
    "[mico]": MicoSettings,
    "[[mico.controller]]": MicoControllerSettings,
    "[[mico.contact]]": MicoContactSettings,
    "[mico.defaults]": MotionDefaults,
    "[mico.jog]": JogSettings,
    "[mico.undo]": UndoSettings,
    "[mico.watch]": WatchSettings,
    "[mico.initialisation]": InitialisationSettings,
    "[[mico.initialisation.step]]": StepSettings,
    "[mico.mirror]": MirrorSettings,
    "[mico.teleoperation]": TeleoperationSettings,
    "[[mico.teleoperation.profile]]": TeleoperationProfileSettings,
    "[[mico.teleoperation.profile.axis]]": TeleoperationAxisSettings,
    "[[mico.group]]": GroupSettings,
    "[[mico.link]]": LinkSettings,
    "[[mico.positioner]]": PositionerSettings,
    "[daqco]": DaqcoSettings,
    "[[daqco.driver]]": DriverSettings,
    "[[daqco.scale]]": ScaleSettings,
    "[[daqco.channel]]": ChannelSettings,
    "[[daqco.limit]]": LimitSettings,
    "[daqco.camera_trigger]": CameraTriggerSettings,
    "[[daqco.output]]": OutputSettings,
    "[vico]": VicoSettings,
    "[[vico.camera]]": CameraConfig,
    "[[vico.tool]]": ToolSettings,
    "[vico.lens]": MotorLensSettings,
    "[[vico.lens.step]]": ZoomStepSettings,
    "[vico.light]": LampSettings,
    "[control]": ControlSettings,
    "[alarms]": AlarmSettings,
    "[alarms.force]": RisingLevels,
    "[alarms.disk_gb]": FallingLevels,
    "[network]": NetworkSettings,
    "[network.http]": HttpSettings,
    "[[network.http.client]]": HttpClient,
    "[network.epics]": EpicsSettings,
    "[kinds.NAME]": StageKind,
    "[controller]": ControllerSettings,
    "[[devices]]": DeviceWiring,
    "[stages]": StageSettings,
    "[geometry]": GeometrySettings,
    "[geometry.joints]": JointDrive,
    "[geometry.grippers]": GripperGeometry,
    "[contact]": ContactSettings,
    "[handling]": HandlingSettings,
    "[[fibres]]": FibreSettings,
    "[samples.NAME]": SampleSettings,
    "[standards.NAME]": StandardSettings,
    "[plate]": PlateSettings,
    "[climate]": ClimateSettings,
    "[force_sensors.NAME]": ForceSensorSettings,
    "[lens]": LensSettings,
    "[lens.zoom]": LensMotorSettings,
    "[light]": LightSettings,
    "[optics]": OpticsSettings,
    "[optics.camera]": SensorSettings,
    "[optics.views.NAME]": ViewSettings,
    "[optics.picture]": ImageSettings,
}
WHOLE_FILES: Final = (PlatformFile, TwinSettings)

_UNITS: Final = (
    ("_un_mm", "µN/mm"),
    ("_un_k", "µN/K"),
    ("_uc_m2", "µC/m²"),
    ("_deg_mm", "°/mm"),
    ("_ppm_k", "ppm/K"),
    ("_k", "K"),
    ("_n_m2", "N m²"),
    ("_un_sqrt_s", "µN/√s"),
    ("_un_um", "µN/µm"),
    ("_v_un", "V/µN"),
    ("_un_s", "µN/s"),
    ("_un", "µN"),
    ("_n", "N"),
    ("_counts_s2", "counts/s²"),
    ("_counts_s", "counts/s"),
    ("_counts", "counts"),
    ("_percent", "%"),
    ("_um_s2", "µm/s²"),
    ("_deg_s2", "°/s²"),
    ("_um_s", "µm/s"),
    ("_deg_s", "°/s"),
    ("_deg_c", "°C"),
    ("_um_px", "µm/px"),
    ("_db", "dB"),
    ("_um", "µm"),
    ("_deg", "°"),
    ("_hz", "Hz"),
    ("_px", "px"),
    ("_ppm", "ppm"),
    ("_grey", "grey levels"),
    ("_per_mm2", "1/mm²"),
    ("_dv", "0.1 V"),
    ("_v", "V"),
    ("_s", "s"),
)
_TYPES: Final = {
    "integer": "whole number",
    "number": "number",
    "boolean": "true or false",
    "string": "text",
}


def rows(model: type[BaseModel]) -> Iterator[tuple[str, str, str, str]]:
    """Yield key, type with range, unit and default of every key that is no table of its own."""
    schema = model.model_json_schema()
    required = schema.get("required", [])
    for key, described in schema["properties"].items():
        parts = [described, described.get("items", {}), described.get("additionalProperties", {})]
        parts += described.get("anyOf", [])
        if any("$ref" in part for part in parts if isinstance(part, dict)):
            continue
        # The schema does not tell what a factory makes; here they make empty tables only.
        empty: dict[str, Any] | None = {} if described.get("type") == "object" else None
        default = "required" if key in required else _toml(described.get("default", empty))
        yield f"`{key}`", _kind(described, schema.get("$defs", {})), _unit(key), default


def _kind(described: dict[str, Any], definitions: dict[str, Any]) -> str:
    if "anyOf" in described:
        choices = [each for each in described["anyOf"] if each.get("type") != "null"]
        return " or ".join(_kind(each, definitions) for each in choices)
    if "const" in described:
        return f"`{json.dumps(described['const'])}`"
    if "enum" in described:
        return ", ".join(f"`{json.dumps(each)}`" for each in described["enum"])
    if described["type"] == "array":
        return _array(described, definitions)
    if described["type"] == "object":
        entries = described["additionalProperties"]
        return "table" if entries is True else f"table: {_kind(entries, definitions)}"
    return f"{_TYPES[described['type']]}{_range(described)}"


def _array(described: dict[str, Any], definitions: dict[str, Any]) -> str:
    parts = described.get("prefixItems")
    if parts is not None:
        return f"list of {len(parts)}: {_kind(parts[0], definitions)}"
    return f"list: {_kind(described['items'], definitions)}"


def _range(described: dict[str, Any]) -> str:
    low, high = described.get("minimum"), described.get("maximum")
    if low is not None and high is not None:
        return f", {low:.10g} to {high:.10g}"
    texts = [
        (described.get("exclusiveMinimum"), "above {:g}"),
        (low, "from {:g}"),
        (high, "up to {:g}"),
        (described.get("exclusiveMaximum"), "below {:g}"),
    ]
    found = [text.format(value) for value, text in texts if value is not None]
    if described.get("minLength"):
        found.append("not empty")
    return "".join(f", {text}" for text in found)


def _unit(key: str) -> str:
    return next((unit for ending, unit in _UNITS if key.endswith(ending)), "")


def _toml(value: Any) -> str:
    return "none" if value is None else f"`{json.dumps(value)}`"
