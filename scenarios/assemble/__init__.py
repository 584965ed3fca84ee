"""From the sections of a scenario to parts that run."""
