"""Drawn scenes with moving parts: a waving person, a workshop."""
