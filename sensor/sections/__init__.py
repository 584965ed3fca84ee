"""The [sensor] section of a scenario and the sections below it."""
