"""A drawn person who waves an arm."""
