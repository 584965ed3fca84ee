"""The display in the chain of a run: its stages, the images of observers, and its outcome."""
