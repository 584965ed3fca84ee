"""A link on patches and pilots: plan, check and choice of a mode."""
