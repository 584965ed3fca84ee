"""The report of an imager's run, and tools for its figures."""
