"""The clock of the panel, from the sequence of its pilots."""
