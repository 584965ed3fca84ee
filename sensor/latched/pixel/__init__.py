"""The pixel: distribution of its intervals, and the exact tier in three bit-identical forms."""
