"""Conventional imagers as whole machines: pixel, sequencer cycle by cycle, registers, trace."""

from rtl_model.imagers.bus import ImagerBus
from rtl_model.imagers.catalogue import design, machine

__all__ = [
    "ImagerBus",
    "design",
    "machine",
]
