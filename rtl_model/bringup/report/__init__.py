"""The report of a bring-up: HTML page, figures, one line a stage, and JUnit XML."""
