"""The pages of a latched camera and of a display."""
