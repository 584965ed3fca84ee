"""Detectors: from spikes to a soft bit for each cell and symbol."""
