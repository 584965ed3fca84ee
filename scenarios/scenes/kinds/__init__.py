"""The kinds of scene: one file each, with its section of a scenario and its source."""
