"""A link made ready, filmed and received."""
