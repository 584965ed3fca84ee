"""Closed forms that simulations are held against: error rates, fading, capacity."""
