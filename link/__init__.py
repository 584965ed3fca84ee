"""Bytes over light: framing, coding, cells, channel, detectors, theory and capacity."""
