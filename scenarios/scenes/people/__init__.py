"""A drawn person who waves."""
