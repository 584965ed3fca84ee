"""Light: planes of light over time, lenses, photometry, what a scene's light will be."""
