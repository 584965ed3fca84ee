"""The first-spike code (Huang 2022, section 5.2): only changes of the light are sent."""

from sensor.codec.coding import Code, recode
from sensor.codec.law import entropy_bounds, event_rate
from sensor.codec.trains import first_spikes, without_transitions

__all__ = [
    "Code",
    "entropy_bounds",
    "event_rate",
    "first_spikes",
    "recode",
    "without_transitions",
]
