"""Soft values of a group that a line code reads as given values."""

import numpy as np

from link.layout import Layout
from link.line_codes import encode_line


def soft_of(layout: Layout, values: np.ndarray, quality: np.ndarray | float = 9.0) -> np.ndarray:
    """Soft values, (symbols, cells) float32, of the values, (cells,), with a magnitude for each."""
    shown = encode_line(layout.mode.line, values[None])
    return np.where(shown, np.float32(1), np.float32(-1)) * np.float32(quality)
