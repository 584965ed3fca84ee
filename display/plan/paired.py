"""The paired check with displays: words of cameras on displays of patches, compared as radiance.

Radiance is relative to the white of the panel, as the selected observer integrates it around each
of its instants. The truth is the display with every effect, with the words of the reference camera.
For a moving eye, a patch is continued periodically at its edges (`display/plan/pixels.py`): the
check measures changes between the pixels of a tile, but not those at an edge between two tiles.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim import Block, Light
from cosim.plan.error import Measured
from cosim.plan.paired import CheckCamera, Paired, Span, Values, Words, compare, worst
from cosim.plan.tiles import PatchPlane
from cosim.spikes.viform import WORD, pack_planes, unpack_planes, words_for
from display.observe.observers import CameraPlane, FixedEye, PursuingEye
from display.plan.pixels import PatchDisplay
from display.setting import DisplaySetting

TRUTH = "truth"
"""Name of the display with every effect."""
_NAMES = {FixedEye: "an eye", PursuingEye: "a pursuing eye", CameraPlane: "a camera"}
PREFIX = "display/"
SPAN = "planes within "
KEPT = "words of "
"""Begins the keys of the words of cameras in a state."""


@dataclass(frozen=True)
class CheckDisplay:
    """A display whose plan is checked.

    Attributes:
        full: the display with every effect.
        run: the planned display.
        cycles: length of the run, cycles.
    """

    full: DisplaySetting
    run: DisplaySetting
    cycles: int

    @property
    def observer_name(self) -> str:
        return _NAMES.get(type(self.full.observer), "the observer")


def _joined(parts: list[tuple[Words, int]]) -> Words:
    """Words of consecutive (words, cycles)."""
    if len(parts) == 1:
        return parts[0][0]
    planes = [unpack_planes(words[:, None, :], 0, cycles) for words, cycles in parts]
    return pack_planes(np.concatenate(planes))[:, 0]


class DisplayPatches:
    """Displays on patches.

    Args:
        plane: the patches.
        settings: displays by name, each with the name of the camera whose words it shows.
        floor: lower limit of the rate to which errors are relative, spikes a cycle.
        keep: keeps the words of each camera, for `replayed`.
    """

    def __init__(
        self,
        plane: PatchPlane,
        settings: dict[str, tuple[str, DisplaySetting]],
        floor: float,
        keep: bool = False,
    ) -> None:
        self._plane, self._settings, self._least = plane, settings, floor
        self._kept: dict[str, list[tuple[Words, int]]] | None = {} if keep else None
        self._of = {name: camera for name, (camera, _) in settings.items()}
        self._displays = {
            name: PatchDisplay(setting, plane.rows, plane.columns, plane.row)
            for name, (_, setting) in settings.items()
        }
        self._waiting: dict[str, list[tuple[Words, int]]] = {}
        self._floor = floor / next(iter(settings.values()))[1].panel.white_rate

    def take(self, camera: str, words: Words, cycles: int) -> None:
        """Stores the next words of a camera, (words, pixels), for `show`."""
        if camera in self._of.values():
            self._waiting.setdefault(camera, []).append((words, cycles))

    def show(self, block: Block) -> None:
        """Shows the words of a whole block. Spans of planes begin with the block, as in the run."""
        joined = {camera: _joined(parts) for camera, parts in self._waiting.items()}
        self._waiting.clear()
        for name, display in self._displays.items():
            display.step(joined[self._of[name]], block.start, block.cycles)
        if self._kept is not None:
            for camera, words in joined.items():
                self._kept.setdefault(camera, []).append((words, block.cycles))

    def replayed(
        self, names: Sequence[str], change: Callable[[Words, int], Words]
    ) -> DisplayPatches:
        """These displays after the words of the whole run, changed. Needs `keep`.

        Args:
            names: names of the displays.
            change: map from the words of a camera, (words, pixels), and their cycles, to others.
        """
        assert self._kept is not None
        chosen = {name: self._settings[name] for name in names}
        again = DisplayPatches(self._plane, chosen, self._least)
        changed, blocks = {}, []
        for camera in {camera for camera, _ in chosen.values()}:
            blocks = self._kept[camera]
            cycles = sum(count for _, count in blocks)
            changed[camera] = change(_joined(blocks), cycles)
        start = 0
        for _, count in blocks:
            block = Block(start, count)
            for camera, words in changed.items():
                again.take(camera, words[start // WORD : words_for(block.stop)], count)
            again.show(block)
            start = block.stop
        return again

    def images(self, name: str) -> Values:
        """Images of a display, (images, patches, pixels), white = 1."""
        return self._plane.split(self._displays[name].images)

    def limit(self, name: str, truth: str) -> Values:
        """Upper limit of the change from one display to another, (images, patches)."""
        return compare(self.images(name), self.images(truth), self._floor)[2]

    def errors(self, name: str, truth: str = TRUTH) -> Values:
        """Relative RMS difference of a display, (images, patches)."""
        return compare(self.images(name), self.images(truth), self._floor)[0]

    def error(self, name: str, truth: str = TRUTH) -> Measured:
        """The largest error of a display, over images and patches."""
        return worst(self.images(name), self.images(truth), self._floor)

    def state(self) -> dict[str, npt.NDArray[Any]]:
        """Everything that the next block depends on."""
        return {
            f"{name}/{key}": value
            for name, display in self._displays.items()
            for key, value in display.state().items()
        } | {
            f"{KEPT}{camera}/{n}/{count}": words
            for camera, parts in (self._kept or {}).items()
            for n, (words, count) in enumerate(parts)
        }

    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None:
        """Restores a `state`."""
        if self._kept is not None:
            self._kept.clear()
            for key, words in state.items():
                if key.startswith(KEPT):
                    camera, _, count = key.removeprefix(KEPT).rsplit("/", 2)
                    self._kept.setdefault(camera, []).append((words, int(count)))
        for name, display in self._displays.items():
            display.restore({
                key.removeprefix(f"{name}/"): value
                for key, value in state.items() if key.startswith(f"{name}/")
            })  # fmt: skip


class DisplayCheck(Paired):
    """Cameras on patches, and displays that show their words.

    Args:
        plane, cameras, spans: see `Paired`.
        displays: displays on patches, None for a check of cameras only.
        also: see `Paired`.
    """

    def __init__(
        self,
        plane: PatchPlane,
        cameras: Mapping[str, CheckCamera],
        spans: Sequence[Span],
        displays: DisplayPatches | None,
        *,
        also: Sequence[Span] = (),
    ) -> None:
        super().__init__(plane, cameras, spans, also=also)
        self.displays = displays

    def filmed(self, name: str, words: Words, start: int, cycles: int) -> None:
        if self.displays is not None:
            self.displays.take(name, words, cycles)

    def step(self, light: Light, block: Block) -> Light:
        """Exposes the patches to a block of light and shows the words; passes the light on."""
        out = super().step(light, block)
        if self.displays is not None:
            self.displays.show(block)
        return out

    def state(self) -> dict[str, npt.NDArray[Any]]:
        """Everything the next block depends on."""
        if self.displays is None:
            return super().state()
        return super().state() | {f"{PREFIX}{k}": v for k, v in self.displays.state().items()}

    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None:
        """Restores a `state`."""
        inner = {k: v for k, v in state.items() if k.startswith(PREFIX)}
        super().restore({k: v for k, v in state.items() if k not in inner})
        if self.displays is not None:
            self.displays.restore({k.removeprefix(PREFIX): v for k, v in inner.items()})


def partial_displays(
    display: CheckDisplay, names: Sequence[str]
) -> dict[str, tuple[str, DisplaySetting]]:
    """For each of these effects, the display without it, and the name of the display with which it
    is compared. Names of other effects are ignored. Coarser spans are compared with the next finer
    ones."""
    partial: dict[str, tuple[str, DisplaySetting]] = {}
    absent = [effect.name for effect in display.full.acting_effects if effect.name in names]
    spans: list[str] = []
    for name in absent:
        if name.startswith(SPAN):
            before = f"without {spans[-1]}" if spans else TRUTH
            spans.append(name)
            partial[name] = before, display.full.without(spans)
        else:
            partial[name] = TRUTH, display.full.without([name])
    return partial
