"""Streams of spikes: words, events, absolute intensities."""
