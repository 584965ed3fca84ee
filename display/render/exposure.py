"""Accumulates images on the GPU in float32, and transfers them to float64 sums regularly.

The relative error of a float32 sum of n similar terms is at most n · 3e-8 (n / 2 half-units in the
last place). After FLUSH draw calls (4.8e-7 in the worst case; 1e-7 in practice, because rounding
errors differ in sign), a sum is read back and added to a float64 sum. An exposure of hours is then
as accurate as one draw call.
"""

from __future__ import annotations

import moderngl
import numpy as np
import numpy.typing as npt

FLUSH = 16
"""Number of draw calls to an image before it is read back."""
Values = npt.NDArray[np.float64]


class Exposures:
    """The images of a renderer.

    Args:
        context: GL context.
        count: number of images.
        shape: (height, width), pixels.
        quads: number of fragments in a row, four pixels each.
    """

    def __init__(
        self, context: moderngl.Context, count: int, shape: tuple[int, int], quads: int
    ) -> None:
        self._context, self._shape, self._quads = context, shape, quads
        self._textures: dict[int, moderngl.Texture] = {}
        self._targets: dict[int, moderngl.Framebuffer] = {}
        self._draws = [0] * count
        self._sums: dict[int, Values] = {}

    def target(self, image: int) -> moderngl.Texture:
        """The texture of an image for one draw call with blending, RGBA32F. Reads the image back
        first if necessary."""
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
        """The image so far, (height, width) float64."""
        if self._draws[image]:
            self._flush(image)
        if image not in self._sums:
            return np.zeros(self._shape)
        return self._sums[image].copy()

    def take(self, image: int) -> Values:
        """The image so far, (height, width) float64; resets the image to 0."""
        values = self.read(image)
        self._sums.pop(image, None)
        return values

    def put(self, images: Values) -> None:
        """Sets the images, (images, height, width)."""
        for image, values in enumerate(images):
            self.take(image)
            if values.any():
                self._sums[image] = values.copy()

    def all(self) -> Values:
        """All images so far, (images, height, width) float64."""
        return np.stack([self.read(n) for n in range(len(self._draws))]) if self._draws else (
            np.zeros((0, *self._shape))
        )  # fmt: skip
