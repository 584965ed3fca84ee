"""The report of a run of an asynchronous camera."""
