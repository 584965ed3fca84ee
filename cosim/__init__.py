"""Ground floor: time, units, light, spikes and their files, effects, OpenCL, random numbers, the
run loop. Every part stands on it; it knows none of them."""

from cosim.clock import PS, Clock, seconds_to_ps
from cosim.effects import Bound, Effect, Summary
from cosim.errors import InputError, Interrupted, ViformError
from cosim.events import Events, events_of, viform_of
from cosim.frames import Frame
from cosim.intensities import Intensities, intensity_image, join_intensities, last_reports
from cosim.lens import Lens
from cosim.light import Box, Light, Piece, Plane
from cosim.loop import BLOCK, Block, Checkpoint, run_blocks
from cosim.viform import SpikeStream, Viform

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
    "Frame",
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
    "events_of",
    "intensity_image",
    "join_intensities",
    "last_reports",
    "run_blocks",
    "seconds_to_ps",
    "viform_of",
]
