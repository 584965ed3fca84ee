"""A display that is called: words of spikes in, images of its observers out, in memory.

The display is set up once. A call shows words block by block on a panel and gives what observers
see of its light. It writes nothing. A run does the same around it (`display/chain`) with a slow
motion and checkpoints, so both give the same bits.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from threading import Lock
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim.compute.opencl import Device
from cosim.plan.effects import Kind
from cosim.spikes.ancillary import Ancillary
from cosim.spikes.viform import WORD, Words
from cosim.stage import Stage, blocks
from display.observe.observers import STAGES, eye_time
from display.observe.views import Observer, Views, panel_views
from display.panels.panel import SpikePanel
from display.render.ancillary import Follower
from display.render.factory import DRAW, AnyRenderer, make_renderer
from display.render.kinds import RendererKind
from display.render.opencl import OpenCLRenderer
from display.setting import DisplaySetting

Images = dict[str, npt.NDArray[np.float32]]
Mapped = Callable[[Words], Words]

ARITHMETIC: Final = 1e-6
"""Deviation of the renderers from the golden model, of white."""
_TOGETHER: Final = 1024
_BITS: Final = 2**29
"""Planes, and spikes of a stream, that kernels show at once; they give the same bits however whole
64 planes are joined."""
_KEPT: Final = 2
"""Renderers that are kept for later calls, for two threads that call at the same time: the kernels
of each take all cores."""
_CHOSEN: Final[set[Device]] = set()
"""Devices whose kernels the renderer `auto` has chosen: to choose, it opens a GL context, which
takes 5 ms, and 40 KB that Mesa does not give back."""


@dataclass(frozen=True)
class Bounds:
    """What a display promises of the error of its images against full physics.

    Attributes:
        bound: Limit of the error of a pixel of an image, of white.
        kind: "proof", or "estimate".
        left_out: Limit for each effect that is left out, by name.
    """

    bound: float
    kind: Kind
    left_out: dict[str, float] = field(default_factory=dict)


def short_notes(luminance: float, seconds: float) -> list[str]:
    """A note if a run of light is shorter than the response of the eye (two standard deviations on
    each side)."""
    whole = 4 * math.sqrt(STAGES) * eye_time(luminance)
    if seconds >= whole:
        return []
    return [
        f"the run is shorter than the {whole * 1e3:.2g} ms that an eye integrates: the images of "
        "the eyes have only the light of the run"
    ]


class LiveDisplay:
    """A panel that is shown words block by block, and the images of its observers.

    Args:
        setting: the panel, and the resolution in time.
        observers: observers by name.
        renderer: creates a renderer for a number of images. It is called in the constructor, so
            that its errors come first.
        mapping: maps words of the stream to words of the panel; None for equal sizes.
        others: number of images of the renderer besides those of the observers.
        stream: (height, width) of the stream, for one with writes; None for one without.

    Attributes:
        renderer: draws the panel.
    """

    def __init__(
        self,
        setting: DisplaySetting,
        observers: Mapping[str, Observer],
        renderer: Callable[[int], AnyRenderer],
        mapping: Mapped | None = None,
        others: int = 0,
        stream: tuple[int, int] | None = None,
    ) -> None:
        self._stream = stream
        self._batch, self._observers = setting.batch, dict(observers)
        self._panel, self._mapping = setting.simulated_panel, mapping
        self._own = sum(observer.images for observer in self._observers.values())
        self.renderer = renderer(self._own + others)
        self._follower = Follower(self.renderer, self._panel, mapping, stream)
        self._ahead: list[Ancillary] = []  # ancillary data of planes that are not rendered yet
        self._waiting: list[Words] = []  # words that are not rendered yet
        self._first = self._planes = 0  # first plane and number of planes of `_waiting`

    def push(
        self, words: Words, cycles: int, *, last: bool = False,
        ancillary: Sequence[Ancillary] = (),
    ) -> None:  # fmt: skip
        """Takes the next cycles of the stream.

        Args:
            words: (ceil(cycles / 32), height, width) uint32 of the stream; bits beyond are 0.
            cycles: number of cycles; whole words, except at the end.
            last: whether the stream ends with them.
            ancillary: what the source says in these cycles, in their order.
        """
        self._ahead += ancillary
        self._waiting.append(words if self._mapping is None else self._mapping(words))
        self._planes += cycles
        # The next block cannot continue an incomplete word.
        if last or self._planes + cycles > DRAW or self._planes % WORD:
            self._draw()

    def _draw(self) -> None:
        words = self._waiting[0] if len(self._waiting) == 1 else np.concatenate(self._waiting)
        first, planes = self._first, self._planes
        ahead, self._ahead = self._ahead, []
        self._waiting, self._first, self._planes = [], first + planes, 0
        for part, begin, count in self._follower.parts(words, planes, first, ahead):
            self._render(part, begin, count)

    def _render(self, words: Words, first: int, planes: int) -> None:
        views = Views.joined(self._views(first, planes))
        packet = self._follower.packet
        if packet != 1.0:
            views = replace(views, weight=views.weight * packet, slope=views.slope * packet)
        self.renderer.step(words, planes, views)

    def _views(self, first: int, planes: int) -> list[Views]:
        """The views of all images for planes `first` to `first + planes`."""
        return [
            panel_views(observer, self._panel, first, planes, self._batch)
            for observer in self._observers.values()
        ]

    def take(self) -> Images:
        """What the observers have seen, (images, height, width), white = 1; the images of the
        renderer begin anew."""
        seen, at = {}, 0
        for name, observer in self._observers.items():
            images = np.empty((observer.images, *self._panel.shape), np.float32)
            for image in images:
                image[:] = self.renderer.take(at)
                at += 1
            seen[name] = images
        return seen


class CalledDisplay:
    """A display, ready to be called from any thread.

    Args:
        renderer: see `make_renderer`.
        device: OpenCL device of the renderer, or None for the default one.
    """

    def __init__(self, renderer: RendererKind = "auto", device: Device | None = None) -> None:
        self._kind, self._device = renderer, device
        self._kept: list[OpenCLRenderer] = []
        self._lock, self._most = Lock(), _KEPT

    def forget(self) -> None:
        """Gives back what is kept for later calls, and keeps nothing from now on."""
        with self._lock:
            kept, self._kept, self._most = self._kept, [], 0
        for renderer in kept:
            renderer.close()

    def show(
        self, source: Stage, cycles: int, setting: DisplaySetting,
        observers: Mapping[str, Observer], mapping: Mapped | None = None,
    ) -> Images:  # fmt: skip
        """Shows a stream.

        Args:
            source: gives the planes of a block, see `StreamStage`.
            cycles: length of the stream.
            setting: the panel for it, and the resolution in time.
            observers: observers by name.
            mapping: maps words of the stream to words of the panel; None for equal sizes.

        Returns:
            What the observers see, by name, (images, height, width) float32, white = 1.

        Raises:
            InputError: the panel cannot be rendered, or memory is short.
        """
        bare = _bare(setting.simulated_panel)
        display = LiveDisplay(
            setting,
            observers,
            lambda images: self._renderer(bare, setting.batch, images),
            mapping,
            stream=getattr(source, "shape", None),
        )
        renderer = display.renderer
        try:
            size = DRAW
            if isinstance(renderer, OpenCLRenderer):
                pixels = bare.shape[0] * bare.shape[1]
                size = max(DRAW, min(_TOGETHER, _BITS // pixels // DRAW * DRAW))
            for block in blocks(cycles, size):
                part = source.step(None, block)
                display.push(
                    part.words, part.cycles, last=block.stop == cycles, ancillary=part.ancillary
                )
            seen = display.take()
        except BaseException:
            renderer.close()
            raise
        self._keep(renderer)
        return seen

    def _renderer(self, panel: SpikePanel, batch: int, images: int) -> AnyRenderer:
        """A renderer in its first state: one that is kept, or a new one."""
        with self._lock:
            for n, kept in enumerate(self._kept):
                if (kept.panel, kept.batch, kept.images) == (panel, batch, images):
                    return self._kept.pop(n)
        kind = "opencl" if self._kind == "auto" and self._device in _CHOSEN else self._kind
        renderer = make_renderer(kind, panel, batch, images, device=self._device)
        if kind == "auto" and self._device is not None and isinstance(renderer, OpenCLRenderer):
            _CHOSEN.add(self._device)
        return renderer

    def _keep(self, renderer: AnyRenderer) -> None:
        """Keeps a renderer for later calls. One of shaders belongs to its thread, and is closed."""
        if not isinstance(renderer, OpenCLRenderer):
            renderer.close()
            return
        renderer.reset()
        with self._lock:
            self._kept.append(renderer)
            spare = [self._kept.pop(0)] if len(self._kept) > self._most else []
        for each in spare:
            each.close()


def _bare(panel: SpikePanel) -> SpikePanel:
    """The panel without what a renderer does not depend on; the views of the observers do."""
    return replace(panel, white_rate=1.0, row_scan=0.0, transport=0, fill=1.0, luminance=1.0)
