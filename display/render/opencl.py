"""A spike-continuous panel and its observers in OpenCL, for machines whose GL is software.

The kernels (planes.cl) take the words of the chip as they are and accumulate the planes of a block
in one pass: a row's light stays in the cache until all images have it. The images equal those of
`GoldenRenderer` within 1e-6 of white, as those of the shaders do.
"""

from __future__ import annotations

from importlib.resources import files
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim.compute.memory import check_memory
from cosim.compute.opencl import Device, open_device, wide_cl
from cosim.compute.outputs import Outputs
from display.observe.views import Views
from display.panels.panel import LEVELS, SpikePanel, relaxation, slow
from display.render.golden import FOREVER
from display.render.shader import split_images, states, takes_light

GROUPS: Final = 4
"""Number of groups of sixteen pixels that a work-item steps together."""
LANES: Final = 16 * GROUPS
WINDOW: Final = 16
"""Maximum number of spans of a row that are kept in the cache."""
PLANES: Final = 64
"""Maximum number of planes in these spans, unless a span is longer. Their weighted sum is float32;
images are sums of such sums in float64."""
TOGETHER: Final = 8
"""Number of images to which the light of a few pixels is added at once."""
ITEMS: Final = 16
"""Number of work-items for each core: enough for an even load, few enough for their rows to stay in
the cache."""
NO_SPAN: Final = 2**32 - 1
VIEW: Final = 8
"""Numbers of a view in a span; the same in planes.cl."""
Words = npt.NDArray[np.uint32]
Values = npt.NDArray[np.float64]


class OpenCLRenderer:
    """The interface of `GoldenRenderer` in OpenCL kernels, on a processor.

    The state of a pixel is that of the shaders: tau and age + 1 (uint32, 0 for none), the memory of
    the drive and its light since the last spike (float32), and the level of the emitter (uint32
    steps). Blocks of whole 64 planes give the same bits however they are joined.

    Args:
        panel: the panel.
        batch: number of planes in a span of light.
        images: number of images of the observers.
        device: OpenCL device, None for the default one.

    Attributes:
        panel, batch, images: panel, planes a batch and images, as given.

    Raises:
        InputError: there is no OpenCL device, or not enough memory.
    """

    def __init__(
        self, panel: SpikePanel, batch: int, images: int, device: Device | None = None
    ) -> None:
        if batch < 1:
            raise ValueError(f"batch must be 1 or more, not {batch}")
        self.panel, self.batch, self.images = panel, batch, images
        height, width = panel.shape
        self._line = -(-width // LANES) * LANES
        self._names = states(panel.scheme, slow(panel))
        pixels = height * self._line
        check_memory(
            "the panel", pixels * (8 * len(self._names) + 8 * images + 8),
            "make it smaller (display.width, display.height)",
        )  # fmt: skip
        self._device = open_device() if device is None else device
        self.name = f"OpenCL, {self._device.name}"
        self._window = max(1, min(PLANES // batch, WINDOW))
        self._rows = -(-height // (ITEMS * self._device.units))
        self._items = -(-height // self._rows)
        shape = max(len(self._names), 1), height, self._line
        self._states = [self._share(np.zeros(shape, np.uint32)) for _ in range(2)]
        """The state before the last block, and after it."""
        self._images = self._share(np.empty((max(images, 1), height, self._line)))
        self._fresh = np.ones(images, np.bool_)
        self._spans = self._share(np.empty((self._items, self._window, self._line), np.float32))
        self._kernels: dict[tuple[str, bool], Any] = {}
        self._taken = Outputs(np.float64)
        self._last: tuple[Words, int] | None = None

    def _share(self, array: npt.NDArray[Any]) -> tuple[npt.NDArray[Any], Any]:
        return array, self._device.share(array, write=True)

    def _kernel(self, name: str, whole: bool) -> Any:
        """The kernel `show` or `look`; with `whole`, the light of all rows is kept."""
        if (name, whole) not in self._kernels:
            drive = self.panel.scheme
            emits, pulsed = slow(self.panel), slow(self.panel) and self.panel.share < 1
            switches = {
                "WHOLE": whole, "SINGLE": self.batch == 1,
                "COUNTED": drive.spikes == 0 and not emits and self.batch > 1,
                "INTERVALS": "tau" in self._names, "MEMORY": "memory" in self._names,
                "EMITS": emits, "PULSED": pulsed,
            }  # fmt: skip
            values = {
                "GROUPS": GROUPS, "WINDOW": WINDOW, "VIEW": VIEW, "TOGETHER": TOGETHER,
                "LEVEL_AT": len(self._names) - 1,
            }  # fmt: skip
            text = [f"#define {key}" for key, on in switches.items() if on]
            values |= {"DARK": self.panel.dark} if self.panel.dark else {}
            text += [f"#define {key} {value}" for key, value in values.items()]
            text += [f"#define LEVEL ({drive.glsl})", f"#define REMEMBER ({drive.glsl_remember})"]
            text.append(wide_cl())
            text.append((files("display.render") / "planes.cl").read_text(encoding="utf-8"))
            options = ("-cl-std=CL1.2", "-cl-single-precision-constant")
            self._kernels[name, whole] = self._device.kernel("\n".join(text), name, options)
        return self._kernels[name, whole]

    def step(self, words: Words, cycles: int, views: Views | None) -> None:
        """Shows `cycles` planes. Raises ValueError for words of another size.

        Args:
            words: (ceil(cycles / 32), height, width) uint32, pixel-major.
            cycles: number of planes.
            views: views for spans of `batch` planes; None for no observer.
        """
        if words.shape[1:] != self.panel.shape:
            raise ValueError(f"words must be of {self.panel.shape} pixels, not {words.shape[1:]}")
        words = np.ascontiguousarray(words)
        self._last = words, cycles
        self._states.reverse()
        spans = -(-cycles // self.batch)
        if views is not None and (views.dy.any() or views.dy_slope.any()):
            for first in range(0, spans, WINDOW):
                self._show_whole(words, cycles, first, views)
        elif views is not None or self._names:
            self._show(words, cycles, (0, spans), self._spans[1], views, False, 0)
            self._device.finish()

    def _show_whole(self, words: Words, cycles: int, first: int, views: Views | None) -> Values:
        """Shows up to WINDOW spans from `first` on; returns their light in all rows, (spans,
        height, line) float32."""
        last = min(first + WINDOW, -(-cycles // self.batch))
        height = self.panel.shape[0]
        light, spans = self._share(np.empty((last - first, height, self._line), np.float32))
        self._show(words, cycles, (first, last), spans, None, True, first)
        if views is not None:
            table = self._views(views, first, last)
            self._kernel("look", True)(
                self._device.queue, (self._items,), (1,), spans, np.uint32(first), np.uint32(last),
                np.uint32(self._window), *map(np.uint32, (height, self._line, self._rows)), *table,
            )  # fmt: skip
        self._device.settle(spans, light)
        return light

    def _show(
        self, words: Words, cycles: int, spans: tuple[int, int], kept: Any, views: Views | None,
        whole: bool, first: int,
    ) -> None:  # fmt: skip
        """One launch of `show`. first: 0 if the state before the block is that before these
        spans."""
        panel, pulse = self.panel, self.panel.share
        before, after = self._states[0 if first == 0 else 1][1], self._states[1][1]
        if not self._names:
            before = after
        emitter = (
            np.array([*relaxation(constant, share, panel), 0], np.float32)
            for constant, share in (
                (panel.rise, pulse), (panel.decay, pulse), (panel.decay, 1 - pulse),
            )
        )  # fmt: skip
        sizes = (*spans, self._window, *panel.shape, self._line, self._rows)
        self._kernel("show", whole)(
            self._device.queue, (self._items,), (1,), self._device.share(words), np.uint32(cycles),
            np.uint32(self.batch), before, after, kept, *map(np.uint32, sizes),
            np.float32(self._unit), np.float32(1 / pulse), *emitter, *self._views(views, *spans),
        )  # fmt: skip

    def _views(self, views: Views | None, first: int, last: int) -> tuple[Any, ...]:
        """Kernel arguments of the images with light in these spans. An image that is fresh is set
        by the first window that it has light in."""
        device, images = self._device, self._images[1]
        spans = [*range(first, last)]
        still, moving = (
            [n for n in numbers if views is not None and takes_light(views, n, spans)]
            for numbers in split_images(views)
        )
        used = still + moving
        if views is None or not used:
            none = device.upload(np.zeros(2, np.uint32))
            return none, np.uint32(0), none, np.uint32(0), np.uint32(0), images
        table = np.zeros((len(used), views.weight.shape[1], VIEW), np.float32)
        for n, name in enumerate(("weight", "slope", "dy", "dy_slope", "dx", "dx_slope")):
            table[..., n] = getattr(views, name)[used]
        for n, name in ((2, "dy"), (4, "dx")):
            shift = getattr(views, name)[used]
            whole = np.floor(shift)
            table[..., n] = shift - whole
            # Beyond the width of the panel everything is dark.
            whole = np.clip(whole, -(2**20), 2**20).astype(np.int32)
            table[..., 6 + n // 4] = whole.view(np.float32)
        which = np.full((len(used), 2), NO_SPAN, np.uint32)
        which[:, 0] = used
        for row, image in zip(which, used, strict=True):
            if self._fresh[image]:
                lit = (views.weight[image] != 0) | (views.slope[image] != 0)
                row[1] = first + int(np.argmax(lit[first:last])) // self._window * self._window
        self._fresh[used] = False
        return (
            device.upload(table), np.uint32(table.shape[1]), device.upload(which),
            np.uint32(len(still)), np.uint32(len(used)), images,
        )  # fmt: skip

    @property
    def light(self) -> Values:
        """Light of the last block, packets Q summed over each span, (spans, height, width) float64.
        The block is shown again for it, from the words of the last `step`."""
        if self._last is None:
            return np.zeros((0, *self.panel.shape))
        words, cycles = self._last
        parts = [
            self._show_whole(words, cycles, first, None)
            for first in range(0, -(-cycles // self.batch), WINDOW)
        ]
        return np.concatenate(parts)[..., : self.panel.shape[1]].astype(np.float64)

    def take(self, image: int) -> Values:
        """The image so far, (height, width) float64; resets the image to 0."""
        values = self._read(image, self._taken.take(self.panel.shape))
        self._fresh[image] = True
        return values

    def _read(self, image: int, into: Values) -> Values:
        if self._fresh[image]:
            into[:] = 0
        else:
            self._device.settle(self._images[1], self._images[0])
            into[:] = self._images[0][image, :, : self.panel.shape[1]]
        return into

    @property
    def _unit(self) -> float:
        return 1 / (self.panel.share * LEVELS)

    def pixels(self) -> dict[str, npt.NDArray[Any]]:
        """The state of the pixels, without the images, with the names of `GoldenRenderer`; arrays
        that the drive does not need are zero."""
        array, buffer = self._states[1]
        self._device.settle(buffer, array)
        width = self.panel.shape[1]
        stored = {
            name: part[:, :width].copy() for name, part in zip(self._names, array, strict=False)
        }
        none = np.zeros(self.panel.shape, np.uint32)
        older = stored.get("age", none)
        return {
            "tau": stored.get("tau", none),
            "age": np.where(older == FOREVER, FOREVER, np.maximum(older, 1) - 1).astype(np.uint32),
            "started": older > 0,
            "memory": stored.get("memory", none).view(np.float32).astype(np.float64),
            "emitted": stored.get("emitted", none).view(np.float32).astype(np.float64),
            "level": np.asarray(stored.get("level", none) * self._unit, np.float64),
        }

    def state(self) -> dict[str, npt.NDArray[Any]]:
        """Everything that the next block depends on, as `pixels`, with the images."""
        images = np.empty((self.images, *self.panel.shape))
        for n in range(self.images):
            self._read(n, images[n])
        return self.pixels() | {"images": images}

    def put_pixels(self, state: dict[str, npt.NDArray[Any]]) -> None:
        """Restores the pixels of a `state` of any renderer; the images stay."""
        older = np.where(state["age"] < FOREVER, state["age"] + np.uint32(1), FOREVER)
        stored = {
            "tau": state["tau"],
            "age": np.where(state["started"], older, 0),
            "memory": state["memory"].astype(np.float32).view(np.uint32),
            "emitted": state["emitted"].astype(np.float32).view(np.uint32),
            "level": np.clip(np.rint(state["level"] / self._unit), 0, LEVELS),
        }
        width = self.panel.shape[1]
        array = np.zeros_like(self._states[1][0])
        for part, name in zip(array, self._names, strict=False):
            part[:, :width] = stored[name]
        self._states[1] = self._share(array)
        self._last = None

    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None:
        """Restores a `state` of any renderer."""
        self.put_pixels(state)
        width = self.panel.shape[1]
        images = np.zeros_like(self._images[0])
        images[: self.images, :, :width] = state["images"]
        self._images = self._share(images)
        self._fresh[:] = False

    def reset(self) -> None:
        """Back to the state before the first block, dark, without images."""
        if self._names:
            array = self._states[1][0]
            array.fill(0)
            self._states[1] = self._share(array)
        self._fresh[:] = True
        self._last = None

    def close(self) -> None:
        """Releases the memory of the images and the state; the renderer cannot be used any more."""
        self._device.finish()
        self._last = None
        self._images = self._spans = self._share(np.zeros((1, 1, 1), np.float32))
        self._states = [self._spans] * 2
