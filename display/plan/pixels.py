"""The light of single pixels and patches of a panel, in compiled code. Tests compare it with
`GoldenRenderer`.

A patch is a part of the panel, 16 x 16 pixels, with unknown surroundings. A still eye does not need
them. For a moving eye, the patch is continued periodically at its edges: light that leaves it on
one side enters on the other. All light of the patch is then integrated, with the differences
between neighbours and one false difference across its edge, within its range of light. An edge
between two patches is not represented.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from numba import njit

from cosim.spikes.viform import WORD, Viform
from display.drives.compiled import compiled, level, remember
from display.observe.views import Views
from display.panels.emitter import Emitter, gone_in, relax
from display.panels.panel import SpikePanel
from display.render.ancillary import Follower
from display.render.golden import FOREVER
from display.setting import DisplaySetting

Values = npt.NDArray[np.float64]
Words = npt.NDArray[np.uint32]


class PixelState(NamedTuple):
    """The state of pixels, as in `GoldenRenderer`; each array is (pixels,)."""

    tau: Words
    age: Words
    started: npt.NDArray[np.bool_]
    memory: Values
    emitted: Values
    level: Values


def _show(words, cycles, batch, spikes, dark, emitter, state, out):  # type: ignore[no-untyped-def]
    """Adds the light of each pixel in each span of planes to `out`, (spans, pixels), packets.
    `compiled` compiles this kernel for a drive."""
    pulse, rise, decay = emitter
    tau, age, started, memory, emitted, glow = state
    instant = rise == 0.0 and decay == 0.0
    up, down = gone_in(pulse, rise), gone_in(pulse, decay)
    up_after, down_after = gone_in(1.0 - pulse, rise), gone_in(1.0 - pulse, decay)
    for pixel in range(words.shape[1]):
        t, a, s = tau[pixel], age[pixel], started[pixel]
        m, e, y = memory[pixel], emitted[pixel], glow[pixel]
        for n in range(cycles):
            fired = (words[n // WORD, pixel] >> np.uint32(n % WORD)) & np.uint32(1)
            if s and a != FOREVER:
                a += np.uint32(1)
            if fired:
                m = remember(m, float(a) if s else 0.0, e)
                e = 0.0
                if s:
                    t = a if dark == 0 or a < dark else np.uint32(0)
                a = np.uint32(0)
                s = True
            lit = (t > 0 if spikes > 1 else s) and (dark == 0 or a < dark)
            x = level(float(a), float(t), m) if lit else 0.0
            e += x
            if instant:
                y = x if pulse == 1.0 else 0.0
                light = x
            else:
                light, y = relax(x / pulse, pulse, y, up, down)
                if pulse < 1.0:
                    more, y = relax(0.0, 1.0 - pulse, y, up_after, down_after)
                    light += more
            out[n // batch, pixel] += light
        tau[pixel], age[pixel], started[pixel] = t, a, s
        memory[pixel], emitted[pixel], glow[pixel] = m, e, y


class PanelPixels:
    """A number of pixels of a panel, which are dark at the start."""

    def __init__(self, panel: SpikePanel, pixels: int) -> None:
        self.panel = panel
        tau, age = (np.zeros(pixels, np.uint32) for _ in range(2))
        values = (np.zeros(pixels) for _ in range(3))
        self._state = PixelState(tau, age, np.zeros(pixels, np.bool_), *values)

    @property
    def level(self) -> Values:
        """Level of the emitters at the end of the last plane, packets a cycle, (pixels,)."""
        return self._state.level

    def light(self, words: Words, cycles: int, batch: int) -> Values:
        """Light of the next planes, packets Q, (spans, pixels).

        Args:
            words: words of the planes, (words, pixels).
            cycles: number of planes.
            batch: number of planes in a span.
        """
        scheme, emitter = self.panel.scheme, Emitter.of(self.panel)
        out = np.zeros((-(-cycles // batch), words.shape[1]))
        words = np.ascontiguousarray(words)
        show, dark = compiled(_show, scheme), np.uint32(self.panel.dark)
        show(words, cycles, batch, scheme.spikes, dark, emitter, self._state, out)
        return out

    def pixels(self) -> dict[str, npt.NDArray[Any]]:
        """The state of the pixels."""
        return self.state()

    def put_pixels(self, state: dict[str, npt.NDArray[Any]]) -> None:
        """Restores the pixels of a `state`."""
        self.restore(state)

    def state(self) -> dict[str, npt.NDArray[Any]]:
        """Everything that the next block depends on."""
        return {name: values.copy() for name, values in self._state._asdict().items()}

    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None:
        """Restores a `state`."""
        self._state = PixelState(**{name: values.copy() for name, values in state.items()})


class FilmedPixels:
    """All pixels of a panel that follows its stream, for a camera that films it.

    Args:
        panel: the panel.
        mapping: map from words of the stream to words of the panel; None for equal sizes.
    """

    def __init__(self, panel: SpikePanel, mapping: Callable[[Words], Words] | None = None) -> None:
        self._mapping = mapping
        self._pixels = PanelPixels(panel, panel.shape[0] * panel.shape[1])
        self._follower = Follower(self._pixels, panel, mapping)

    def words(self, data: Viform) -> Iterator[tuple[int, Values]]:
        """The planes of a block, whole words and a rest: number of planes and their light, (planes,
        height x width), packets at the nominal threshold."""
        self._follower.stream = data.shape
        words = data.words if self._mapping is None else self._mapping(data.words)
        for word, first in enumerate(range(0, data.cycles, WORD)):
            planes, start = min(WORD, data.cycles - first), data.start + first
            ahead = [each for each in data.ancillary if start <= each.cycle < start + planes]
            flat = words[word : word + 1].reshape(1, -1)
            parts = [
                self._pixels.light(part, count, 1) * self._follower.packet
                for part, _, count in self._follower.parts(flat, planes, start, ahead)
            ]
            yield planes, parts[0] if len(parts) == 1 else np.concatenate(parts)

    def state(self) -> dict[str, npt.NDArray[Any]]:
        """Everything that the next block depends on."""
        return self._pixels.state() | {"packet": np.array(self._follower.packet)}

    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None:
        """Restores a `state`."""
        self._follower.packet = float(state["packet"])
        self._pixels.restore({k: v for k, v in state.items() if k != "packet"})


@njit(cache=True, nogil=True)
def _integrate_periodic(light, view, row, rows, image):  # type: ignore[no-untyped-def]
    """Adds the image of a moving eye to `image`, for all patches.

    Args:
        light: light of the spans, (spans, lines, columns).
        view: the arrays of `Views` for this image, in their order.
        row: position of each line on the panel, 0 to 1, (lines,).
        rows: number of lines of a patch.
        image: (lines, columns), updated.
    """
    weight, slope, dy, dx, dy_slope, dx_slope = view
    spans, lines, columns = light.shape
    for s in range(spans):
        if weight[s] == 0.0 and slope[s] == 0.0:
            continue
        for line in range(lines):
            w = weight[s] + slope[s] * row[line]
            first = line // rows * rows
            y, x = dy[s] + dy_slope[s] * row[line], dx[s] + dx_slope[s] * row[line]
            y0, x0 = math.floor(y), math.floor(x)
            fy, fx = y - y0, x - x0
            up = first + (line - first + int(y0)) % rows
            down = first + (line - first + int(y0) + 1) % rows
            left = int(x0) % columns
            for c in range(columns):
                a, b = (c + left) % columns, (c + left + 1) % columns
                one = (1 - fx) * light[s, up, a] + fx * light[s, up, b]
                two = (1 - fx) * light[s, down, a] + fx * light[s, down, b] if fy else 0.0
                image[line, c] += w * ((1 - fy) * one + fy * two)


class PatchDisplay:
    """A display on patches, with the images of its observer.

    Args:
        setting: the simulated display.
        rows, columns: size of a patch, pixels.
        row: row of the panel of each line of the stacked patches, (lines,).

    Attributes:
        images: images so far, (images, pixels); the white of the panel is 1.
    """

    def __init__(
        self, setting: DisplaySetting, rows: int, columns: int, row: npt.NDArray[np.integer[Any]]
    ) -> None:
        self.setting, self._rows, self._columns = setting, rows, columns
        self._row = np.asarray(row, np.float64) / setting.panel.shape[0]
        self._pixels = PanelPixels(setting.panel, len(self._row) * columns)
        self.images = np.zeros((setting.observer.images, len(self._row) * columns))

    def step(self, words: Words, first: int, cycles: int) -> None:
        """Shows the planes `first` to `first + cycles`, with `words` (words, pixels)."""
        light = self._pixels.light(words, cycles, self.setting.batch)
        self._integrate(light, self.setting.views(first, cycles))

    def _integrate(self, light: Values, views: Views) -> None:
        moves = any(a.any() for a in (views.dy, views.dx, views.dy_slope, views.dx_slope))
        if not moves:
            row = np.repeat(self._row, self._columns)
            self.images += views.weight @ light + (views.slope @ light) * row
            return
        shape = len(self._row), self._columns
        for n, image in enumerate(self.images):
            view = tuple(values[n] for values in vars(views).values())
            shaped = light.reshape(-1, *shape)
            _integrate_periodic(shaped, view, self._row, self._rows, image.reshape(shape))

    def state(self) -> dict[str, npt.NDArray[Any]]:
        """Everything that the next block depends on."""
        return {"images": self.images.copy(), **self._pixels.state()}

    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None:
        """Restores a `state`."""
        self.images = state["images"].copy()
        self._pixels.restore({k: v for k, v in state.items() if k != "images"})
