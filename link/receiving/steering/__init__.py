"""The loop that locks a camera's ticks to the panel's planes: the phase by its spikes, the law."""
