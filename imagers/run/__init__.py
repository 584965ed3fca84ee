"""The run of an imager: planned, filmed frame by frame, measured at a ladder of tolerances."""
