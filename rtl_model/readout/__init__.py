"""The readout of the full chip: spike words to the raw words of the row scan, with their timing,
and the buffer and the link behind it."""

from rtl_model.readout.scan import BIT_RATE, Readout, read_in_numpy

__all__ = ["BIT_RATE", "Readout", "read_in_numpy"]
