"""Pixels for the figures of scenes without characteristic points."""

from __future__ import annotations


def spread_points(shape: tuple[int, int], n: int = 10) -> list[tuple[int, int, str]]:
    """`n` pixels spread evenly over a plane by the R2 sequence: row, column, name."""
    height, width = shape
    g = 1.32471795724474602596  # plastic number: its powers space the points evenly
    places = [
        (int(height * ((0.5 + i / g) % 1)), int(width * ((0.5 + i / g**2) % 1)))
        for i in range(1, n + 1)
    ]
    return [(row, column, f"row {row}, column {column}") for row, column in places]
