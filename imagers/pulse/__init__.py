"""Pulse-modulated imagers (document 000, section 2): pulse width and pulse frequency in a frame."""
