"""The clock of the panel, from the sequence that its pilots show."""
