"""Scenes: where the light of a run comes from."""
