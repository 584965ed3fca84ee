"""What an observer sees of the patches: cameras' words on displays, compared as radiance.

Radiance is relative, white of the panel = 1, as the chosen observer integrates it around each of
its instants. The truth is the reference camera's words on the display with everything. A moving eye
sees each patch go on round its edges (`display/panels/pixels.py`): that measures what timing costs
between the pixels of a tile, and not what an edge between two tiles would add.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from cosim import Block, Light
from cosim.plan.paired import Measured, Paired, Span, Values, Words, compare, worst
from cosim.plan.patches import PatchPlane
from cosim.spikes.viform import pack_planes, unpack_planes
from display import CameraPlane, DisplaySetting, FixedEye, PursuingEye
from display.trial.pixels import PatchDisplay
from sensor.latched.patches import PatchCamera

__all__ = ["TRUTH", "Shown", "ShownPaired", "ShownPatches", "left_out_of"]

TRUTH = "truth"
_NAMES = {FixedEye: "an eye", PursuingEye: "a pursuing eye", CameraPlane: "a camera"}
PREFIX = "shown/"
SPAN = "planes within "


@dataclass(frozen=True)
class Shown:
    """A display to be checked. full: with everything. run: as planned. cycles: of the run."""

    full: DisplaySetting
    run: DisplaySetting
    cycles: int

    @property
    def seen_by(self) -> str:
        """The observer, in words."""
        return _NAMES.get(type(self.full.observer), "the observer")


def _joined(parts: list[tuple[Words, int]]) -> Words:
    """Words of stretches that follow each other, each of so many cycles."""
    if len(parts) == 1:
        return parts[0][0]
    planes = [unpack_planes(words[:, None, :], 0, cycles) for words, cycles in parts]
    return pack_planes(np.concatenate(planes))[:, 0]


class ShownPatches:
    """Displays on patches. settings: by name, each with the name of the camera whose words it
    shows. floor: spikes a cycle."""

    def __init__(
        self, plane: PatchPlane, settings: dict[str, tuple[str, DisplaySetting]], floor: float
    ) -> None:
        self._plane = plane
        self._of = {name: camera for name, (camera, _) in settings.items()}
        self._displays = {
            name: PatchDisplay(setting, plane.rows, plane.columns, plane.row)
            for name, (_, setting) in settings.items()
        }
        self._waiting: dict[str, list[tuple[Words, int]]] = {}
        self._floor = floor / next(iter(settings.values()))[1].panel.white_rate

    def take(self, camera: str, words: Words, cycles: int) -> None:
        """What a camera latched next, (words, pixels); it is shown at the block's end."""
        if camera in self._of.values():
            self._waiting.setdefault(camera, []).append((words, cycles))

    def show(self, block: Block) -> None:
        """Shows a block whole: spans of planes begin with it, as in the run."""
        joined = {camera: _joined(parts) for camera, parts in self._waiting.items()}
        self._waiting.clear()
        for name, display in self._displays.items():
            display.step(joined[self._of[name]], block.start, block.cycles)

    def images(self, name: str) -> Values:
        """(images, patches, pixels)."""
        return self._plane.split(self._displays[name].images)

    def limit(self, name: str, truth: str) -> Values:
        """Upper limit of the change from one display to another, (images, patches)."""
        return compare(self.images(name), self.images(truth), self._floor)[2]

    def error(self, name: str, truth: str = TRUTH) -> Measured:
        """The worst."""
        return worst(self.images(name), self.images(truth), self._floor)

    def state(self) -> dict[str, npt.NDArray[Any]]:
        """Everything the next block depends on."""
        return {
            f"{name}/{key}": value
            for name, display in self._displays.items()
            for key, value in display.state().items()
        }

    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None:
        """Go on from a `state`."""
        for name, display in self._displays.items():
            display.restore({
                key.removeprefix(f"{name}/"): value
                for key, value in state.items() if key.startswith(f"{name}/")
            })  # fmt: skip


class ShownPaired(Paired):
    """Cameras on patches, and displays that show what they latch. shown: None for none."""

    def __init__(
        self,
        plane: PatchPlane,
        cameras: Mapping[str, PatchCamera],
        spans: Sequence[Span],
        shown: ShownPatches | None,
    ) -> None:
        super().__init__(plane, cameras, spans)
        self.shown = shown

    def filmed(self, name: str, words: Words, start: int, cycles: int) -> None:
        if self.shown is not None:
            self.shown.take(name, words, cycles)

    def step(self, light: Light, block: Block) -> Light:
        """Films the patches of a block and shows them; the light goes on as it came."""
        out = super().step(light, block)
        if self.shown is not None:
            self.shown.show(block)
        return out

    def state(self) -> dict[str, npt.NDArray[Any]]:
        """Everything the next block depends on."""
        if self.shown is None:
            return super().state()
        return super().state() | {f"{PREFIX}{k}": v for k, v in self.shown.state().items()}

    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None:
        """Go on from a `state`."""
        mine = {k: v for k, v in state.items() if k.startswith(PREFIX)}
        super().restore({k: v for k, v in state.items() if k not in mine})
        if self.shown is not None:
            self.shown.restore({k.removeprefix(PREFIX): v for k, v in mine.items()})


def left_out_of(shown: Shown, names: Sequence[str]) -> dict[str, tuple[str, DisplaySetting]]:
    """Of each of these effects that the display has left out: the display without it, and the name
    of the one to compare it with. Coarser spans are compared with the finer ones alone."""
    made: dict[str, tuple[str, DisplaySetting]] = {}
    mine = [effect.name for effect in shown.full.kept if effect.name in names]
    spans: list[str] = []
    for name in mine:
        if name.startswith(SPAN):
            before = f"without {spans[-1]}" if spans else TRUTH
            spans.append(name)
            made[name] = before, shown.full.without(spans)
        else:
            made[name] = TRUTH, shown.full.without([name])
    return made
