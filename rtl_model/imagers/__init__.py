"""Conventional imagers as whole machines: pixel, sequencer cycle by cycle, registers, trace."""

from rtl_model.imagers.imager import Imager

__all__ = ["Imager"]
