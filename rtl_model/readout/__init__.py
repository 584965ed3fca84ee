"""The readout of the full chip: spike words to the raw words of the row scan, with their timing,
and the buffer and the link behind it."""

from rtl_model.readout.reference import read_in_numpy
from rtl_model.readout.scan import Readout
from rtl_model.readout.timing import BIT_RATE

__all__ = ["BIT_RATE", "Readout", "read_in_numpy"]
