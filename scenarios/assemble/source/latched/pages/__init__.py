"""The report pages of a latched camera and of a display."""
