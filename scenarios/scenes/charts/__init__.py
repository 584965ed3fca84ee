"""Test charts and patches of known light."""
