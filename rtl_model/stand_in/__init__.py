"""A board that replaces the sensor or the display of a scenario, stepped by the host."""

from rtl_model.stand_in.display import BoardDisplay
from rtl_model.stand_in.opening import OpenBoard, open_board
from rtl_model.stand_in.sensor import BoardSensor, finest_level, quantise, written_levels

__all__ = [
    "BoardDisplay",
    "BoardSensor",
    "OpenBoard",
    "finest_level",
    "open_board",
    "quantise",
    "written_levels",
]
