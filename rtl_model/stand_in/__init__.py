"""A board in a scenario's chain: it makes spikes in the sensor's place, or shows planes in the
display's, frame by frame as the host steps it."""

from rtl_model.stand_in.display import BoardDisplay
from rtl_model.stand_in.place import StandIn, stand_in
from rtl_model.stand_in.sensor import BoardSensor, level_for, steps_of

__all__ = [
    "BoardDisplay",
    "BoardSensor",
    "StandIn",
    "level_for",
    "stand_in",
    "steps_of",
]
