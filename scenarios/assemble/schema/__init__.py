"""The schema of scenarios, its error messages, and the loading of scenarios."""
