"""The report of a bring-up: HTML page, figures, a one-line summary of each stage, JUnit XML."""
