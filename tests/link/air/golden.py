"""The panel's image by direct integration: slow, of small arrays, the truth for `link.air`."""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

Values = npt.NDArray[np.float64]


def psf_points(sigma: float, disc: float, airy: float = 0.0) -> tuple[Values, Values]:
    """(n, 2) places and (n,) weights of a Gaussian, a disc and an Airy pattern of first-zero radius
    `airy`, convolved."""
    points, weights = np.zeros((1, 2)), np.ones(1)

    def convolve(places: Values, shares: Values) -> tuple[Values, Values]:
        both = (points[:, None] + places[None]).reshape(-1, 2)
        return both, (weights[:, None] * shares[None]).ravel()

    if sigma > 0:
        count = 9 if sigma < 1 else 21  # evenly over four deviations to either side
        x = (np.arange(count) - count // 2) * (8 / count)
        w = np.exp(-x * x / 2)
        grid = np.stack(np.meshgrid(x, x), -1).reshape(-1, 2) * sigma
        points, weights = convolve(grid, np.outer(w, w).ravel() / w.sum() ** 2)
    if disc > 0:
        points, weights = convolve(
            _rings(disc * np.sqrt((np.arange(6) + 0.5) / 6)), np.ones(96) / 96
        )
    if airy > 0:
        from scipy.special import j0, j1

        # Rings of equal light: 1 - J0^2 - J1^2 within radius z (Born & Wolf, 8.5.18).
        z = np.linspace(0, 400, 40001)
        inside = 1 - j0(z) ** 2 - j1(z) ** 2
        radii = np.interp((np.arange(24) + 0.5) / 24, inside, z) * airy / 3.8317
        points, weights = convolve(_rings(radii), np.ones(24 * 16) / (24 * 16))
    return points, weights


def _rings(radii: Values, around: int = 16) -> Values:
    turn = (np.arange(around) + np.linspace(0, 1, len(radii), endpoint=False)[:, None]) / around
    angle = 2 * math.pi * turn
    return np.stack([radii[:, None] * np.cos(angle), radii[:, None] * np.sin(angle)], -1).reshape(
        -1, 2
    )


def golden(
    plane: npt.NDArray[np.floating],
    homography: Values,
    camera: tuple[int, int],
    sigma: float = 0.0,
    disc: float = 0.0,
    airy: float = 0.0,
    shift: tuple[float, float] = (0.0, 0.0),
    fine: int = 12,
) -> Values:
    """(height, width) mean of the panel's plane over each camera pixel through the PSF, 0 beyond
    the panel; every sample goes back through the homography itself."""
    points, weights = psf_points(sigma, disc, airy)
    at = (np.arange(fine) + 0.5) / fine - 0.5
    inverse = np.linalg.inv(homography)
    out = np.zeros(camera)
    rows, columns = np.arange(camera[0]), np.arange(camera[1])
    x = (columns[:, None] + at[None]).ravel()[None, :]
    y = (rows[:, None] + at[None]).ravel()[:, None]
    height, width = plane.shape
    for (px, py), weight in zip(points, weights, strict=True):
        xx, yy = np.broadcast_arrays(x - px - shift[0], y - py - shift[1])
        u, v, w = np.tensordot(inverse, np.stack([xx, yy, np.ones_like(xx)]), 1)
        i, j = np.rint(u / w).astype(int), np.rint(v / w).astype(int)
        inside = (i >= 0) & (i < width) & (j >= 0) & (j < height) & (w > 0)
        value = np.where(inside, plane[np.clip(j, 0, height - 1), np.clip(i, 0, width - 1)], 0.0)
        sums = value.reshape(camera[0], fine, camera[1], fine).mean(axis=(1, 3))
        out += weight * sums
    return out
