"""From spikes to a file: find the panel, time it, follow it, decode it."""
