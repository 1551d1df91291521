"""Fibres on images from anywhere: `cosmic.measure` and what writes its results."""

from cosmic.vico.core.measuring.corrections import Corrections as Corrections
from cosmic.vico.core.measuring.corrections import side_file as side_file
from cosmic.vico.core.measuring.image_files import SUFFIXES as SUFFIXES
from cosmic.vico.core.measuring.image_files import read_images as read_images
from cosmic.vico.core.measuring.measured_files import write_csv as write_csv
from cosmic.vico.core.measuring.measured_files import write_json as write_json
from cosmic.vico.core.measuring.measured_files import write_napari as write_napari
from cosmic.vico.core.measuring.measured_files import write_networks as write_networks
from cosmic.vico.core.measuring.measured_files import write_overlay as write_overlay
from cosmic.vico.core.measuring.measured_files import write_rois as write_rois
from cosmic.vico.core.measuring.measurement import Measurement as Measurement
from cosmic.vico.core.measuring.measurement import measure as measure
from cosmic.vico.core.measuring.measurement import measure_page as measure_page
from cosmic.vico.core.vision.held import Clamp as Clamp
from cosmic.vico.core.vision.held import HeldShape as HeldShape
from cosmic.vico.core.vision.held import held_shape as held_shape
from cosmic.vico.core.vision.network import Network as Network
from cosmic.vico.core.vision.network import find_network as find_network
from cosmic.vico.core.vision.tips import find_gripper as find_gripper
from cosmic.vico.core.vision.tool_types import ExpectedTool as ExpectedTool
from cosmic.vico.core.vision.tool_types import GripperTips as GripperTips
