"""The digital output of a latched chip in a run: the section [readout]."""
