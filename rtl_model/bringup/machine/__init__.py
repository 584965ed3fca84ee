"""The run of a [board] scenario."""
