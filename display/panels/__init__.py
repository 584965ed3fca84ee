"""Panels: spike-continuous, frame and binary-plane panels as numbers."""
