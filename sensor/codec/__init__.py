"""The first-spike code (Huang 2022, section 5.2): only changes of the light are sent."""

from sensor.codec.coding import BAND, CHUNK, CODES, Code, Frame, encode
from sensor.codec.fsc import FSC, read_fsc, write_fsc
from sensor.codec.law import effective_q, entropy_bounds, event_rate, width_law, width_sigma
from sensor.codec.stream import recode
from sensor.codec.trains import FirstSpikes, first_spikes, levels, repeated, without_transitions

__all__ = [
    "BAND",
    "CHUNK",
    "CODES",
    "FSC",
    "Code",
    "FirstSpikes",
    "Frame",
    "effective_q",
    "encode",
    "entropy_bounds",
    "event_rate",
    "first_spikes",
    "levels",
    "read_fsc",
    "recode",
    "repeated",
    "width_law",
    "width_sigma",
    "without_transitions",
    "write_fsc",
]
