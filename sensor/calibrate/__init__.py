"""Calibration: the parameters of the pixel model from recordings of a real spike camera."""
