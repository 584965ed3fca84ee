"""Reference displays that show the scene: frame panels, a binary projector, and the true light."""
