"""Reference displays: frame panels, a binary projector and the true light, fed the scene."""
