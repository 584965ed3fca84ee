"""Spikes to light: panels, the renderer, observers and display quality."""
