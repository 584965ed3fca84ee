"""Throughput against real time and against the ceiling of this machine."""
