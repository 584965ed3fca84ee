"""Throughput against real time and against this machine's ceiling."""
