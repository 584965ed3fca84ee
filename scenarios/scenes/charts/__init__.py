"""Test charts and patches of known illuminance."""
