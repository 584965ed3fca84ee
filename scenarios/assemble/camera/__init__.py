"""A latched camera and the display that its stream drives: set up, planned, checked, judged."""
