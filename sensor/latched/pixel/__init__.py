"""The pixel: its law of intervals, and the exact tier in three forms that agree bit for bit."""
