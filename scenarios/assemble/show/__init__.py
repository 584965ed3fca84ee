"""A stream of any source is played into the display: its feed, the run, and its pages."""
