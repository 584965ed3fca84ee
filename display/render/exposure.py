"""Images as they gather on the GPU: float32 sums, carried over to float64 before they lose digits.

A sum of n like terms in float32 is off by at most n / 2 half-units of its last place, n · 3e-8 of
itself. After `FLUSH` draws (4.8e-7 at the very worst; 1e-7 is met, since roundings differ in sign)
a sum is read back and added to a float64 one, so that an exposure of hours is as good as a draw.
"""

from __future__ import annotations

import moderngl
import numpy as np
import numpy.typing as npt

__all__ = ["FLUSH", "Exposures"]

FLUSH = 16
"""Draws onto an image before it is read back."""
Values = npt.NDArray[np.float64]


class Exposures:
    """The images of a renderer. count: of images. shape: (height, width). quads: fragments of a
    row, four pixels each."""

    def __init__(
        self, context: moderngl.Context, count: int, shape: tuple[int, int], quads: int
    ) -> None:
        self._context, self._shape, self._quads = context, shape, quads
        self._textures: dict[int, moderngl.Texture] = {}
        self._targets: dict[int, moderngl.Framebuffer] = {}
        self._draws = [0] * count
        self._sums: dict[int, Values] = {}

    def target(self, image: int) -> moderngl.Texture:
        """The texture to add to, once: a flush comes first where one is due. RGBA32F, blended."""
        if image not in self._textures:
            texture = self._context.texture((self._quads, self._shape[0]), 4, dtype="f4")
            self._textures[image] = texture
            self._targets[image] = self._context.framebuffer([texture])
            self._targets[image].clear()
        if self._draws[image] >= FLUSH:
            self._flush(image)
        self._draws[image] += 1
        return self._textures[image]

    def _flush(self, image: int) -> None:
        texture = self._textures[image]
        quads = np.frombuffer(texture.read(alignment=4), np.float32)
        values = quads.reshape(self._shape[0], 4 * self._quads)[:, : self._shape[1]]
        if image in self._sums:
            self._sums[image] += values
        else:
            self._sums[image] = values.astype(np.float64)
        self._targets[image].clear()
        self._draws[image] = 0

    def read(self, image: int) -> Values:
        """(height, width) float64, the image so far."""
        if self._draws[image]:
            self._flush(image)
        if image not in self._sums:
            return np.zeros(self._shape)
        return self._sums[image].copy()

    def take(self, image: int) -> Values:
        """The same; it begins anew."""
        values = self.read(image)
        self._sums.pop(image, None)
        return values

    def put(self, images: Values) -> None:
        """Goes on from (images, height, width)."""
        for image, values in enumerate(images):
            self.take(image)
            if values.any():
                self._sums[image] = values.copy()

    def all(self) -> Values:
        """(images, height, width) float64."""
        return np.stack([self.read(n) for n in range(len(self._draws))]) if self._draws else (
            np.zeros((0, *self._shape))
        )  # fmt: skip
