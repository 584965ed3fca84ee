"""The exact pixel in OpenCL: one specialised kernel for each set of effects."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.resources import files
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim.opencl import Device
from cosim.viform import words_for
from sensor.effects import SHOT_NOISE
from sensor.pixel.fixed_point import Charge
from sensor.pixel.interval import KNOTS, MANTISSA_BITS
from sensor.pixel.model import DEEPEST, JUMP, ExactModel, PixelState, Span

__all__ = ["KernelPixels"]

LANES: Final = 16
"""Pixels in a work-item: a vector of 32-bit integers on a 512-bit processor."""


class KernelPixels:
    """Sixteen pixels a work-item. pixels: their numbers, (n,) uint32, any n.

    The arrays on the device are padded to whole work-items with pixels that get no light.
    """

    def __init__(self, model: ExactModel, pixels: npt.NDArray[np.uint32], device: Device) -> None:
        self._model, self._device = model, device
        self._n = pixels.size
        self._padded = -(-self._n // LANES) * LANES
        self._pixels = self._upload(pixels)
        table: Charge = np.zeros((1, 2), np.int64)
        if model.noisy:
            knots = model.table()
            table = np.stack([knots, np.append(np.diff(knots), 0)], axis=1)
        self._table = device.upload(table)
        self._words: tuple[int, Any] = (0, None)
        self._given: list[tuple[Charge, Any]] = []
        self._kernels: dict[bool, Any] = {}
        self.restore(model.initial(pixels))

    def _upload(self, values: npt.NDArray[Any]) -> Any:
        """A device buffer of the values, with 0 for the pixels that pad them."""
        if values.size != self._padded:
            values = np.pad(values, (0, self._padded - self._n))
        return self._device.upload(values)

    def _kernel(self, ramp: bool) -> Any:
        """The kernel for these effects, with or without a ramp."""
        if ramp not in self._kernels:
            self._kernels[ramp] = self._build(ramp)
        return self._kernels[ramp]

    def _build(self, ramp: bool) -> Any:
        # A threshold drawn for each spike is one fragment, whatever the noise that it stands for.
        source, noise = (files("sensor.pixel") / "exact.cl").read_text(), SHOT_NOISE
        defines = ["-cl-std=CL1.2", f"-DJUMP={JUMP}", f"-DDEEPEST=({DEEPEST}L)"]
        if self._model.noisy:
            source = noise.fragment() + source
            defines += [f"-D{noise.define}", f"-D{noise.define}_STREAM={noise.stream}u"]
            defines += [f"-DKNOTS={KNOTS}u", f"-DMANTISSA_BITS={MANTISSA_BITS}"]
        if ramp:
            defines.append("-DRAMP")
        if self._model.reset != "residual":
            defines.append(f"-DRESET_{self._model.reset.upper()}")
        if self._model.dead:
            defines.append("-DDEAD_TIME")
        return self._device.kernel(source, "expose", tuple(defines))

    def _buffer(self, values: Charge) -> Any:
        """Buffer of an array that the device has been given lately, or a new one."""
        for array, buffer in self._given:
            if array is values:
                return buffer
        buffer = self._upload(values)
        self._given = [*self._given[-3:], (values, buffer)]
        return buffer

    def expose(self, spans: Sequence[Span], cycles: int) -> npt.NDArray[np.uint32]:
        model, n_words = self._model, words_for(cycles)
        if self._words[0] != n_words:
            blank = np.zeros((n_words, self._padded), np.uint32)
            self._words = (n_words, self._device.upload(blank))
        words = self._words[1]
        for span in spans:
            ramp = span.slope is not None
            slope = span.slope if span.slope is not None else span.charge
            self._kernel(ramp)(
                self._device.queue, (self._padded // LANES,), None,
                self._deficit, self._low, self._high, self._pixels,
                self._buffer(span.charge), self._buffer(slope), self._table, words,
                np.int64(model.q), np.int64(model.room), np.uint32(model.seed),
                np.uint32(span.first), np.uint32(span.cycles), np.int64(span.elapsed),
                np.int64(model.dead),
            )  # fmt: skip
        out = np.empty((n_words, self._padded), np.uint32)
        return self._device.download(words, out)[:, : self._n]

    def state(self) -> PixelState:
        deficit = self._device.download(self._deficit, np.empty(self._padded, np.int64))
        low = self._device.download(self._low, np.empty(self._padded, np.uint32))
        high = self._device.download(self._high, np.empty(self._padded, np.uint32))
        spikes = low.astype(np.uint64) | (high.astype(np.uint64) << np.uint64(32))
        return PixelState(deficit[: self._n].copy(), spikes[: self._n].copy())

    def restore(self, state: PixelState) -> None:
        self._deficit = self._upload(state.deficit)
        self._low = self._upload(state.spikes.astype(np.uint32))
        self._high = self._upload((state.spikes >> np.uint64(32)).astype(np.uint32))
