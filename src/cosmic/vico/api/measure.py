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
