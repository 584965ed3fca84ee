"""Observers of a display (eyes and cameras), and the integration of their images."""
