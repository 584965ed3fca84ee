"""Stream codes as a part of a chain: packets of a tile's spikes, which stand alone."""
