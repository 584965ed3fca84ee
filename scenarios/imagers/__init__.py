"""Runs of the other imagers: what they look at, what they keep, what is left of their frames."""
