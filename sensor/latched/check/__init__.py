"""The check of a camera's plan: patches, samples of all tiles, and the bank of thresholds."""
