"""Clips and images as scenes."""
