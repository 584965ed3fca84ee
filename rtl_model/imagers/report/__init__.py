"""The report of an imager's run, and what figures of imagers share."""
