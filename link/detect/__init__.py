"""Detectors: from the spikes of a panel's image to soft values of its bits."""
