"""Waveforms of single pixels: the light of the scene, recorded in a run, and of each display."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim import Block, Clock, Light, Piece, SpikeStream
from cosim.spikes.ancillary import Ancillary
from cosim.spikes.viform import WORD, Words, cut_words, words_for
from display.core import LiveDisplay, Mapped
from display.observe.observers import CameraPlane
from display.panels.panel import FramePanel, Projector, SpikePanel
from display.references.displays import FrameShow, ProjectorShow
from display.render.ancillary import Follower
from display.render.golden import GoldenRenderer
from display.setting import DisplaySetting

Values = npt.NDArray[np.float64]
Instants = npt.NDArray[np.int64]
Place = tuple[int, int]


class LightTap:
    """A stage after the scene that records the light of a few pixels.

    Args:
        places: (row, column) of each pixel.
        clock: clock of the run.
        white: light that counts as 1, in the unit of the light.
    """

    def __init__(self, places: Sequence[Place], clock: Clock, white: float) -> None:
        self._rows, self._columns = (np.array([p[k] for p in places], np.intp) for k in (0, 1))
        self._clock, self._white = clock, np.float32(white)
        self._starts: list[int] = []
        self._stop = 0
        self._firsts: list[npt.NDArray[np.float32]] = []
        self._lasts: list[npt.NDArray[np.float32]] = []

    def _at(self, plane: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        return plane[self._rows, self._columns] / self._white

    def step(self, data: Light, block: Block) -> Light:
        """Records the pieces that begin in the block, and passes the light on."""
        for piece in data.pieces:
            if piece.stop > self._stop and piece.start < self._clock.edge(block.stop):
                self._starts.append(piece.start)
                self._firsts.append(self._at(piece.first))
                self._lasts.append(self._at(piece.last))
                self._stop = piece.stop
        return data

    def light(self) -> Light:
        """The recorded light, (1, places), white = 1."""
        stops = [*self._starts[1:], self._stop]
        return Light(tuple(
            Piece(start, stop, first[None], last[None])
            for start, stop, first, last in zip(
                self._starts, stops, self._firsts, self._lasts, strict=True
            )
        ))  # fmt: skip

    def state(self) -> dict[str, npt.NDArray[Any]]:
        """Everything that the next block depends on."""
        return {
            "starts": np.array([*self._starts, self._stop], np.int64),
            "levels": np.array([self._firsts, self._lasts], np.float32),
        }

    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None:
        """Restores a `state`."""
        *self._starts, self._stop = (int(n) for n in state["starts"])
        self._firsts, self._lasts = (list(levels) for levels in state["levels"])


def panel_waves(panel: FramePanel | Projector, light: Light, at: Instants) -> Values:
    """Light of a panel at the instants `at`, ps, increasing: (samples, places), white = 1."""
    shape = light.shape
    show = (
        FrameShow(panel, shape, 1.0) if isinstance(panel, FramePanel)
        else ProjectorShow(panel, shape, 1.0)
    )  # fmt: skip
    wave = np.zeros((len(at), shape[1]))
    for emitted in show.step(light, min(int(at[-1]) + 1, light.pieces[-1].stop)):
        for span in emitted.spans:
            inside = slice(*np.searchsorted(at, (span.start, span.stop)))
            gain = np.ones(len(at[inside]))
            if span.gain is not None:
                gain = span.gain(at[inside], at[inside] + 1)
            wave[inside] += gain[:, None] * emitted.planes[span.plane][0]
    return wave


def spike_waves(
    stream: SpikeStream,
    panel: SpikePanel,
    places: Sequence[Place],
    stop: int,
    told: Sequence[Ancillary] = (),
) -> tuple[Values, Values]:
    """Light of the pixels of a spike display, plane by plane, without row timing.

    Args:
        stream: displayed stream.
        panel: the panel.
        places: (row, column) of each pixel.
        stop: end of the light, ps.
        told: what the source of the stream says beyond its spikes.

    Returns:
        The instants at which the planes begin, ps, (n + 1,), and the light, (n, places), white = 1.
    """
    rows, columns = ([p[k] for p in places] for k in (0, 1))
    small = replace(panel, shape=(1, len(places)), row_scan=0.0)
    wave = _Wave(small, lambda words: words[:, rows, columns][:, None], stream.shape)
    # Two words are a chunk of a store; more would be joined, with all their pixels.
    chunk = 2 * WORD
    cycles = min(stream.cycles, panel.clock.cycle_at(stop) + 1)
    for n in range(0, cycles, chunk):
        end = min(n + chunk, cycles)
        words = cut_words(stream.read_words(n // WORD, words_for(end)), 0, end - n)
        ahead = [each for each in told if n <= each.cycle < end]
        wave.push(words, end - n, last=True, ancillary=ahead)
    starts = np.array([panel.start(n) for n in range(cycles + 1)], np.float64)
    return starts, np.concatenate(wave.parts) / panel.white_rate


class _Wave(LiveDisplay):
    """The light of a few pixels, plane by plane, packets. parts: (planes, places) each."""

    def __init__(
        self, panel: SpikePanel, mapping: Mapped, stream: tuple[int, int]
    ) -> None:  # fmt: skip
        setting = DisplaySetting(panel, CameraPlane((), 1))
        super().__init__(
            setting, {}, lambda images: GoldenRenderer(panel, 1, images), mapping, stream=stream
        )
        self._follower = _AtPlaces(self.renderer, panel, mapping, stream)
        self.parts: list[Values] = []

    def _render(self, words: Words, first: int, planes: int) -> None:
        self.renderer.step(words, planes, None)
        self.parts.append(self._follower.packet * self.renderer.light[:, 0])


class _AtPlaces(Follower):
    """Planes of charges have the places alone, as `PanelStage.told` keeps them."""

    def on_panel(self, values: npt.NDArray[Any]) -> npt.NDArray[np.uint32]:
        at_places = values.shape == self._panel.shape
        return values.astype(np.uint32) if at_places else super().on_panel(values)
