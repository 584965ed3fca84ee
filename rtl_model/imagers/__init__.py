"""Conventional imagers as whole machines: pixel, sequencer cycle by cycle, registers, trace."""

from rtl_model.imagers.bus import ImagerBus
from rtl_model.imagers.catalogue import bus_target, design

__all__ = [
    "ImagerBus",
    "bus_target",
    "design",
]
