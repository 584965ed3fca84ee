"""The exact pixel in OpenCL: a specialised kernel for each set of effects."""

from __future__ import annotations

from collections.abc import Iterable
from importlib.resources import files
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim.compute.opencl import Device, wide_cl
from cosim.compute.outputs import Outputs
from cosim.compute.philox import philox_cl
from cosim.compute.streams import Stream
from cosim.spikes.viform import words_for
from sensor.latched.pixel.charge import Charge, Span, charge_source
from sensor.latched.pixel.interval import KNOTS, MANTISSA_BITS
from sensor.latched.pixel.model import DEEPEST, JUMP, ExactModel, PixelState

LANES: Final = 16
"""Pixels in a work-item: a vector of 32-bit integers on a 512-bit processor."""
_SHORT: Final = 8
"""Longest span, in cycles, that shares a launch with other spans."""
_PLANES: Final = 8
"""Arrays of charges and slopes that such a launch reads."""
_LOCAL: Final = 8
"""Work-items that share a core of a processor. PoCL allocates the private arrays of all of them at
once, and compiles a kernel again for every other number of them."""


class KernelPixels:
    """Sixteen pixels a work-item. pixels: (n,) uint32, their numbers, for any n.

    The arrays on the device are padded to whole work-items with pixels without light.
    """

    def __init__(self, model: ExactModel, pixels: npt.NDArray[np.uint32], device: Device) -> None:
        self._model, self._device = model, device
        self._outputs = Outputs(np.uint32, device.memory)
        self._n = pixels.size
        self._padded = -(-self._n // LANES) * LANES
        self._pixels = self._upload(pixels)
        table: Charge = np.zeros((1, 2), np.int64)
        if model.noisy:
            knots = model.table()
            table = np.stack([knots, np.append(np.diff(knots), 0)], axis=1)
        self._table = device.upload(table)
        self._words: tuple[int, Any] = (0, None)
        self._buffers: list[tuple[Charge, Any]] = []
        self._kernels: dict[tuple[str, bool], Any] = {}
        self.restore(model.initial(pixels))

    def _upload(self, values: npt.NDArray[Any]) -> Any:
        """A device buffer of the values, padded with 0."""
        if values.size != self._padded:
            values = np.pad(values, (0, self._padded - self._n))
        return self._device.upload(values)

    def _sizes(self, groups: int) -> tuple[tuple[int], tuple[int]]:
        """Work-items, in whole work-groups, and the size of a work-group."""
        items, local = self._device.groups(groups, _LOCAL)
        return (items,), (local,)

    def _kernel(self, name: str, ramp: bool = False) -> Any:
        """The kernel `expose`, with or without a ramp, or `walk`; built on first use."""
        if (name, ramp) not in self._kernels:
            self._kernels[name, ramp] = self._build(name, ramp)
        return self._kernels[name, ramp]

    def _build(self, name: str, ramp: bool) -> Any:
        folder = files("sensor.latched.pixel")
        source = wide_cl() + (folder / "exact.cl").read_text(encoding="utf-8")
        defines = ["-cl-std=CL1.2", f"-DJUMP={JUMP}", f"-DDEEPEST=({DEEPEST}L)"]
        defines.append(f"-DPLANES={_PLANES}")
        if self._model.noisy:
            # One fragment draws thresholds, for all kinds of noise.
            source = philox_cl() + (folder / "threshold.cl").read_text(encoding="utf-8") + source
            defines += ["-DSHOT_NOISE", f"-DSHOT_NOISE_STREAM={int(Stream.SHOT_NOISE)}u"]
            defines += [f"-DKNOTS={KNOTS}u", f"-DMANTISSA_BITS={MANTISSA_BITS}"]
        if self._model.transfers:
            source = charge_source(self._model.transfers) + source
            defines.append("-DTRANSFER")
        if ramp:
            defines.append("-DRAMP")
        if self._model.reset != "residual":
            defines.append(f"-DRESET_{self._model.reset.upper()}")
        if self._model.dead:
            defines.append("-DDEAD_TIME")
        return self._device.kernel(source, name, tuple(defines))

    def _buffer(self, values: Charge) -> Any:
        """Buffer over the memory of an array, new or from a recent call. The arrays stay referenced
        as long as a kernel may read them."""
        for array, buffer in self._buffers:
            if array is values:
                return buffer
        whole = values.size == self._padded and values.flags.c_contiguous
        buffer = self._device.share(values) if whole else self._upload(values)
        self._buffers.append((values, buffer))
        return buffer

    def _release(self) -> None:
        """Releases all but the latest arrays, once no kernel reads them."""
        if len(self._buffers) > 4 * _PLANES:
            self._device.finish()
            self._buffers = self._buffers[-4:]

    def _expose(self, span: Span, words: Any) -> None:
        """One launch for one span."""
        model, ramp = self._model, span.slope is not None
        slope = span.slope if span.slope is not None else span.charge
        groups = self._padded // LANES
        self._kernel("expose", ramp)(
            self._device.queue, *self._sizes(groups),
            self._deficit, self._low, self._high, self._pixels,
            self._buffer(span.charge), self._buffer(slope), self._table, words,
            np.int64(model.q), np.int64(model.room), np.uint32(model.seed),
            np.uint32(span.first), np.uint32(span.cycles), np.int64(span.elapsed),
            np.int64(model.dead), np.uint32(groups),
        )  # fmt: skip

    def _walk(self, spans: list[Span], words: Any) -> None:
        """One launch for consecutive short spans."""
        model, arrays = self._model, _arrays(spans)
        places = {id(array): n for n, array in enumerate(arrays)}
        entries = [
            (
                s.first,
                s.cycles,
                places[id(s.charge)],
                places.get(id(s.slope), -1),
                s.elapsed,
                places.get(id(s.advance), -1),
            )
            for s in spans
        ]
        groups = self._padded // LANES
        planes = [self._buffer(array) for array in arrays]
        planes += planes[:1] * (_PLANES - len(planes))
        self._kernel("walk")(
            self._device.queue, *self._sizes(groups),
            self._deficit, self._low, self._high, self._pixels, self._table, words,
            np.int64(model.q), np.int64(model.room), np.uint32(model.seed), np.int64(model.dead),
            np.uint32(groups), self._device.upload(np.array(entries, np.int64)),
            np.uint32(len(entries)), *planes,
        )  # fmt: skip

    def expose(self, spans: Iterable[Span], cycles: int) -> npt.NDArray[np.uint32]:
        n_words = words_for(cycles)
        if self._words[0] != n_words:
            blank = np.zeros((n_words, self._padded), np.uint32)
            self._words = (n_words, self._device.upload(blank))
        words = self._words[1]
        short: list[Span] = []
        for span in spans:
            # `expose` requires charge linear in time, which a ramp after a transfer is not.
            curved = self._model.transfers and span.slope is not None
            brief = span.cycles <= _SHORT or curved
            if short and (not brief or len(_arrays([*short, span])) > _PLANES):
                self._walk(short, words)
                short = []
            if brief:
                short.append(span)
            else:
                self._expose(span, words)
            self._release()
        if short:
            self._walk(short, words)
        out = self._outputs.take((n_words, self._padded))
        done = self._device.download(words, out)[:, : self._n]
        self._buffers = self._buffers[-4:]
        return done

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


def _arrays(spans: list[Span]) -> list[Charge]:
    """The arrays of spans, each once."""
    each = (a for s in spans for a in (s.charge, s.slope, s.advance))
    arrays = {id(a): a for a in each if a is not None}
    return list(arrays.values())
