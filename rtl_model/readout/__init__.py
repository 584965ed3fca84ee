"""The chip's output at full size: words of pixels to the raw words of the row scan, with the time
of every block."""

from rtl_model.readout.plain import plain_readout
from rtl_model.readout.scan import Readout
from rtl_model.readout.timing import BIT_RATE, BLOCK_PS, ScanTiming
from rtl_model.readout.window import Window

__all__ = ["BIT_RATE", "BLOCK_PS", "Readout", "ScanTiming", "Window", "plain_readout"]
