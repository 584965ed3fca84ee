"""Measurement of a display's costs and of the change by effects that are left out."""
