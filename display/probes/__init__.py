"""Probes: test light that a camera records and a display shows, for latency, blur and flicker."""
