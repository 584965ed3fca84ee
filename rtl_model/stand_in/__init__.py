"""A board in a scenario's chain: it makes spikes in the sensor's place, or shows planes in the
display's, frame by frame as the host steps it."""

from rtl_model.stand_in.display import BoardDisplay, Shown
from rtl_model.stand_in.place import DEFAULT_BAUD, StandIn, parse_place, stand_in
from rtl_model.stand_in.sensor import BoardSensor, level_for, steps_of

__all__ = [
    "DEFAULT_BAUD",
    "BoardDisplay",
    "BoardSensor",
    "Shown",
    "StandIn",
    "level_for",
    "parse_place",
    "stand_in",
    "steps_of",
]
