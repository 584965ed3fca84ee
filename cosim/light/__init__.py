"""Light: planes of light over time, lenses, photometry, and surveys of scenes."""
