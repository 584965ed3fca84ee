"""A run of a link in its parts: made ready, filmed, received, judged, foreseen."""
