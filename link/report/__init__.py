"""The pages of a link's report."""
