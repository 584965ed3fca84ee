"""Diagnosis of a failed transmission: one cause, the figures that support it, and a remedy."""
