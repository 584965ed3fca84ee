"""The digital side of the chip, cycle by cycle: registers, readout, sequencers and boards."""
