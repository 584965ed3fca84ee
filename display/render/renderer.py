"""A spike-continuous panel and its observers in fragment shaders, with many planes in a draw call.

The images equal those of `GoldenRenderer` within 1e-6 of white. Words are uploaded unchanged, four
neighbouring pixels in a texel. Up to 128 planes are unrolled in one draw call, together with the
images of still observers; the light of groups of planes is written to textures for moving
observers.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import moderngl
import numpy as np
import numpy.typing as npt

from cosim import InputError
from cosim.compute.memory import check_memory
from cosim.spikes.viform import WORD
from display.observe.views import Views
from display.panels.panel import LEVELS, SpikePanel, relaxation, slow
from display.render.context import DRAW_BUFFERS, check_alive, open_context
from display.render.exposure import Exposures
from display.render.golden import FOREVER
from display.render.shader import (
    GROUPS,
    DriveSwitches,
    ObserverSwitches,
    Piece,
    group_size,
    pieces,
    split_images,
    states,
    takes_light,
    vertex,
)

PLANES = 128
"""Maximum number of planes in a draw call: four words per pixel."""
TERMS = 64
"""Maximum number of weights in a draw call, images times groups: unrolled code must be compiled."""
BUFFERS = 8
"""Number of tables of weights, used in turn, so that none is written while a draw call reads it."""
Words = npt.NDArray[np.uint32]
Values = npt.NDArray[np.float64]


class Renderer:
    """The interface of `GoldenRenderer` in shaders, on a new GL context (`open_context`) or on that
    of the caller, such as a window.

    The state of each pixel is in textures: tau and age + 1 (uint32, 0 for none), the memory of the
    drive and its light since the last spike (bits of float32), and the level of the emitter (uint32
    steps). Ages are limited to 2^32 -
    1; the relative error of a tau beyond 4e6 cycles is 1e-5. Only the thread that creates the
    renderer may use it. Every method raises InputError if the context is lost or closed, or if its
    memory is not sufficient.

    Args:
        panel: the panel.
        batch: number of planes in a span of light.
        images: number of images of the observers.
        context: GL context of the caller, None for a new one.
    """

    def __init__(
        self, panel: SpikePanel, batch: int, images: int, context: moderngl.Context | None = None
    ) -> None:
        if batch < 1:
            raise ValueError(f"batch must be 1 or more, not {batch}")
        self.panel, self.batch = panel, batch
        height, width = panel.shape
        self._quads = -(-width // 4)
        self._names = states(panel.scheme, slow(panel))
        self._states = len(self._names)
        # A draw call has a limited number of targets: the state, and the light of groups.
        self._groups = min(GROUPS, 1 << (DRAW_BUFFERS - self._states).bit_length() - 1)
        bytes_a_pixel = 4 * (3 * self._states + 8 + GROUPS) + 12 * images
        check_memory(
            "the panel", height * 4 * self._quads * bytes_a_pixel,
            "make it smaller (display.width, display.height)",
        )  # fmt: skip
        self._owns_context = context is None
        self._context = open_context() if context is None else context
        self.name: str = self._context.info["GL_RENDERER"]
        self._check_size()
        with self._alive():
            self._words = [[self._texture("u4") for _ in range(4)] for _ in range(2)]
            self._state_textures = [[self._texture("u4") for _ in self._names] for _ in range(3)]
            self._spans: list[moderngl.Texture] = []
            zeros = bytes(height * self._quads * 16)
            for texture in self._state_textures[0]:
                texture.write(zeros)
            self._tables = [self._context.buffer(reserve=TERMS * 16) for _ in range(BUFFERS)]
            self._exposures = Exposures(self._context, images, panel.shape, self._quads)
        self._programs: dict[Any, tuple[moderngl.Program, moderngl.VertexArray]] = {}
        self._targets: dict[tuple[int, ...], moderngl.Framebuffer] = {}
        self._images = images
        self._now = self._start = 0
        """Numbers of the current set of state textures, and of the set before the block."""
        self._draws = self._uploads = 0
        self._last: tuple[Words, int] | None = None
        self._lit: Values | None = np.zeros((0, *panel.shape))

    def _check_size(self) -> None:
        most = int(self._context.info["GL_MAX_TEXTURE_SIZE"])
        height, width = self.panel.shape
        if height > most or self._quads > most:
            self.close()
            raise InputError(
                "the panel", f"at most {4 * most} x {most} pixels ({self.name})",
                f"{width} x {height}", "make it smaller (display.width, display.height)",
            )  # fmt: skip

    def _texture(self, dtype: str) -> moderngl.Texture:
        texture = self._context.texture((self._quads, self.panel.shape[0]), 4, dtype=dtype)
        texture.filter = moderngl.NEAREST, moderngl.NEAREST
        return texture

    @contextmanager
    def _alive(self) -> Iterator[None]:
        """Makes the context current, and checks it before and after."""
        check_alive(self._context)
        with self._context:
            try:
                yield
            except moderngl.Error:
                check_alive(self._context)
                raise
            check_alive(self._context)

    def step(self, words: Words, cycles: int, views: Views | None) -> None:
        """Shows `cycles` planes. Raises ValueError for words of another size.

        Args:
            words: (ceil(cycles / 32), height, width) uint32, pixel-major.
            cycles: number of planes.
            views: views for spans of `batch` planes; None for no observer.
        """
        if words.shape[1:] != self.panel.shape:
            raise ValueError(f"words must be of {self.panel.shape} pixels, not {words.shape[1:]}")
        self._last, self._lit = (words, cycles), None
        with self._alive():
            self._start = self._now
            still, moving = split_images(views)
            loaded: tuple[int, int] | None = None
            for piece in pieces(cycles, self._most(len(still), bool(moving)), self.batch):
                if not (still or moving or self._states):
                    continue
                loaded = self._upload(words, piece, loaded)
                self._show(piece, views, still, moving)

    def _most(self, still: int, moving: bool) -> int:
        """Maximum number of planes in a draw call, by its weights and its targets."""
        group = group_size(PLANES, self.batch)
        if moving:
            return min(PLANES, self._groups * group)
        images = max(1, min(still, DRAW_BUFFERS - self._states))
        return min(PLANES, group * (1 << (TERMS // images).bit_length() - 1))

    def _upload(
        self, words: Words, piece: Piece, loaded: tuple[int, int] | None
    ) -> tuple[int, int]:
        """Uploads the words of a piece to textures, unless they are `loaded`; returns the first
        word and the number of words."""
        word, count = piece.first // WORD, -(-piece.planes // WORD)
        if loaded != (word, count):
            self._uploads += 1
            for n in range(count):
                plane = words[word + n]
                if plane.shape[1] % 4:
                    wide = np.zeros((plane.shape[0], 4 * self._quads), np.uint32)
                    wide[:, : plane.shape[1]] = plane
                    plane = wide
                self._words[self._uploads % 2][n].write(np.ascontiguousarray(plane))
        for n in range(count):
            self._words[self._uploads % 2][n].use(n)
        return word, count

    def _show(self, piece: Piece, views: Views | None, still: list[int], moving: list[int]) -> None:
        """Draws a piece of the block, in as many draw calls as its images need; updates the
        state."""
        if views is not None:
            still, moving = (
                [n for n in images if takes_light(views, n, piece.spans)]
                for images in (still, moving)
            )
        following = next(n for n in range(3) if n not in (self._start, self._now))
        room = DRAW_BUFFERS - self._states - (self._groups if moving else 0)
        rest = list(still)
        while True:
            images, rest = rest[:room], rest[room:]
            if images or moving or self._states:
                self._drive(piece, views, images, bool(moving), following)
            if moving and views is not None:
                for image in moving:
                    self._integrate(image, views, piece.spans)
                moving, room = [], DRAW_BUFFERS - self._states
            if not rest:
                break
        if self._states:
            self._now = following

    def _drive(
        self, piece: Piece, views: Views | None, images: list[int], write_spans: bool,
        following: int,
    ) -> None:  # fmt: skip
        """One draw call for a piece.

        Args:
            piece: the planes.
            views: views of all images, None without images.
            images: numbers of the still images to update.
            write_spans: whether the light of each group is written to a texture.
            following: number of the set of textures for the new state.
        """
        panel, spans = self.panel, piece.spans
        slopes = views is not None and bool(views.slope[np.ix_(images, spans)].any())
        emits = slow(panel)
        switches = DriveSwitches(
            panel.scheme, piece.planes, piece.group, len(images), slopes, write_spans, emits,
            emits and panel.share < 1, panel.dark,
        )  # fmt: skip
        program, triangle = self._program(switches)
        for n, texture in enumerate(self._state_textures[self._now]):
            texture.use(4 + n)
        _set(program, "skip", piece.first % WORD)
        targets = list(self._state_textures[following])
        targets += self._span_textures(len(spans)) if write_spans else []
        targets += [self._exposures.target(image) for image in images]
        if views is not None and images:
            table = np.zeros((len(images), len(spans), 4), np.float32)
            table[..., 0] = views.weight[np.ix_(images, spans)]
            table[..., 1] = views.slope[np.ix_(images, spans)]
            self._bind(table)
        self._draw(targets, triangle)

    def _integrate(self, image: int, views: Views, spans: list[int]) -> None:
        """Adds the spans of the last draw call to the image of a moving observer."""
        shift = np.array([views.dy[image, spans], views.dx[image, spans]])
        slope = np.array([views.dy_slope[image, spans], views.dx_slope[image, spans]])
        whole = np.floor(shift)
        table = np.zeros((len(spans), 8), np.float32)
        table[:, 0], table[:, 1] = views.weight[image, spans], views.slope[image, spans]
        table[:, 2], table[:, 3] = shift[0] - whole[0], slope[0]
        table[:, 4], table[:, 5] = shift[1] - whole[1], slope[1]
        # Beyond the width of the panel everything is dark; the integers of the shader stay small.
        table[:, 6:] = np.clip(whole, -(2**20), 2**20).T
        vertical = bool(shift[0].any() or slope[0].any())
        _, triangle = self._program(ObserverSwitches(len(spans), vertical))
        for n, texture in enumerate(self._span_textures(len(spans))):
            texture.use(n)
        self._bind(table)
        self._draw([self._exposures.target(image)], triangle)
        for n in range(4):  # restores the texture units of the words
            self._words[self._uploads % 2][n].use(n)

    def _span_textures(self, count: int) -> list[moderngl.Texture]:
        while len(self._spans) < count:
            self._spans.append(self._texture("u4"))
        return self._spans[:count]

    def _bind(self, table: npt.NDArray[np.float32]) -> None:
        self._draws += 1
        buffer = self._tables[self._draws % BUFFERS]
        buffer.write(table)
        buffer.bind_to_uniform_block(0)

    def _draw(self, targets: list[moderngl.Texture], triangle: moderngl.VertexArray) -> None:
        key = tuple(texture.glo for texture in targets)
        if key not in self._targets:
            self._targets[key] = self._context.framebuffer(targets)
        self._targets[key].use()
        self._context.enable_only(moderngl.BLEND)  # GL blends only float targets
        self._context.blend_func = moderngl.ONE, moderngl.ONE
        triangle.render(moderngl.TRIANGLES, vertices=3)

    def _program(
        self, switches: DriveSwitches | ObserverSwitches
    ) -> tuple[moderngl.Program, moderngl.VertexArray]:
        if switches not in self._programs:
            program = self._context.program(vertex_shader=vertex(), fragment_shader=switches.source)
            for name, value in self._constants().items():
                _set(program, name, value)
            self._programs[switches] = program, self._context.vertex_array(program, [])
        return self._programs[switches]

    def _constants(self) -> dict[str, Any]:
        """Constant uniforms: the texture units, and the constants of the emitter."""
        panel = self.panel
        pulse = panel.share
        return {
            **{f"words{n}": n for n in range(4)}, **{f"span{n}": n for n in range(GROUPS)},
            **{f"{name}_before": n for n, name in enumerate(self._names, 4)},
            "height": panel.shape[0],
            "unit": 1 / (pulse * LEVELS), "peak": 1 / pulse,
            "rise": relaxation(panel.rise, pulse, panel),
            "fall": relaxation(panel.decay, pulse, panel),
            "rest": relaxation(panel.decay, 1 - pulse, panel),
        }  # fmt: skip

    @property
    def light(self) -> Values:
        """Light of the last block, packets Q summed over each span, (spans, height, width) float64.
        The block is drawn again for it, from the words of the last `step`."""
        if self._lit is None:
            assert self._last is not None
            words, cycles = self._last
            self._lit = np.zeros((-(-cycles // self.batch), *self.panel.shape))
            with self._alive():
                self._now = self._start
                loaded: tuple[int, int] | None = None
                for piece in pieces(cycles, self._most(0, True), self.batch):
                    loaded = self._upload(words, piece, loaded)
                    following = next(n for n in range(3) if n not in (self._start, self._now))
                    self._drive(piece, None, [], True, following)
                    textures = self._span_textures(len(piece.spans))
                    for span, texture in zip(piece.spans, textures, strict=True):
                        self._lit[span] += self._read(texture).view(np.float32)
                    self._now = following if self._states else self._now
        return self._lit

    def _read(self, texture: moderngl.Texture) -> Words:
        quads = np.frombuffer(texture.read(), np.uint32)
        height, width = self.panel.shape
        return np.ascontiguousarray(quads.reshape(height, 4 * self._quads)[:, :width])

    def take(self, image: int) -> Values:
        """The image so far, (height, width) float64; resets the image to 0."""
        with self._alive():
            return self._exposures.take(image)

    def pixels(self) -> dict[str, npt.NDArray[Any]]:
        """The state of the pixels, without the images, with the names of `GoldenRenderer`; arrays
        that the drive does not need are zero."""
        with self._alive():
            textures = zip(self._names, self._state_textures[self._now], strict=True)
            stored = {name: self._read(texture) for name, texture in textures}
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
        with self._alive():
            images = self._exposures.all()
        return self.pixels() | {"images": images}

    @property
    def _unit(self) -> float:
        return 1 / (self.panel.share * LEVELS)

    def put_pixels(self, state: dict[str, npt.NDArray[Any]]) -> None:
        """Restores the pixels of a `state` of this renderer or of the golden model; the images
        stay."""
        older = np.where(state["age"] < FOREVER, state["age"] + np.uint32(1), FOREVER)
        stored = {
            "tau": state["tau"],
            "age": np.where(state["started"], older, 0),
            "memory": state["memory"].astype(np.float32).view(np.uint32),
            "emitted": state["emitted"].astype(np.float32).view(np.uint32),
            "level": np.clip(np.rint(state["level"] / self._unit), 0, LEVELS),
        }
        with self._alive():
            for name, texture in zip(self._names, self._state_textures[self._now], strict=True):
                wide = np.zeros((self.panel.shape[0], 4 * self._quads), np.uint32)
                wide[:, : self.panel.shape[1]] = stored[name]
                texture.write(wide)
        self._last, self._lit = None, np.zeros((0, *self.panel.shape))

    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None:
        """Restores a `state` of this renderer or of the golden model."""
        self.put_pixels(state)
        with self._alive():
            self._exposures.put(state["images"])

    def close(self) -> None:
        """Releases the renderer's own context, with all images that have not been read."""
        if self._owns_context:
            self._context.release()


def _set(program: moderngl.Program, name: str, value: Any) -> None:
    """Sets a uniform if the shader has it."""
    uniform = program.get(name, None)
    if isinstance(uniform, moderngl.Uniform):
        uniform.value = value
