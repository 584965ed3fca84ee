"""Stiff and extreme cases of pixels, each beside a reference of its own."""
