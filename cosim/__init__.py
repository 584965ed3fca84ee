"""The base of all parts: time, units, light, spikes and their files, effects, OpenCL, random
numbers and the run. It imports no other part."""

from cosim.clock import PS, Clock, seconds_to_ps
from cosim.errors import InputError, Interrupted, ViformError
from cosim.light.lens import Lens
from cosim.light.light import Box, Light, Piece, Plane
from cosim.plan.effects import Bound, Effect, Summary
from cosim.run.loop import Checkpoint, run_blocks
from cosim.spikes.events import Events
from cosim.spikes.intensities import Intensities, intensity_image, join_intensities, last_reports
from cosim.spikes.viform import SpikeStream, Viform
from cosim.stage import BLOCK, Block

__all__ = [
    "BLOCK",
    "PS",
    "Block",
    "Bound",
    "Box",
    "Checkpoint",
    "Clock",
    "Effect",
    "Events",
    "InputError",
    "Intensities",
    "Interrupted",
    "Lens",
    "Light",
    "Piece",
    "Plane",
    "SpikeStream",
    "Summary",
    "Viform",
    "ViformError",
    "intensity_image",
    "join_intensities",
    "last_reports",
    "run_blocks",
    "seconds_to_ps",
]
