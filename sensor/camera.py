"""The spike camera as one stage of a run: `Light` in, `Viform` out, block by block."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cosim.clock import Clock
from cosim.effects import Effect
from cosim.light import Light
from cosim.loop import Block
from cosim.opencl import Device
from cosim.radiometry import photons_per_lux
from cosim.viform import Viform
from sensor.chips import Chip
from sensor.crosstalk import crosstalk_map
from sensor.effects import (
    EFFECTS,
    comparator_delay_effect,
    crosstalk_effect,
    dead_time_effect,
    pattern_effects,
    row_sampling_effect,
    threshold_noise_effect,
)
from sensor.exposure import Exposure
from sensor.pattern import DevicePattern
from sensor.pixel.model import ExactModel, ExactPixels, PixelState, Reset
from sensor.sampling import row_offsets

__all__ = ["CameraSetting", "SpikeCamera", "make_pixels"]


@dataclass(frozen=True)
class CameraSetting:
    """chip: preset. clock: of the latches. threshold: electrons. seed: of the run, below 2^32.
    wavelength_nm: at which lux are counted as photons. effects: those kept. pattern: of the device,
    None for a perfect one. threshold_noise: electrons. reset: rule. dead_time: seconds after each
    spike in which light is lost, at most a cycle. row_skew: share of a cycle in which the rows are
    sampled one after another. comparator_delay: seconds, at most a cycle. crosstalk: share of its
    light that a pixel loses to its neighbours."""

    chip: Chip
    clock: Clock
    threshold: float
    seed: int
    wavelength_nm: float = 555.0
    effects: tuple[Effect, ...] = tuple(EFFECTS.values())
    pattern: DevicePattern | None = None
    threshold_noise: float = 0.0
    reset: Reset = "residual"
    dead_time: float = 0.0
    row_skew: float = 0.0
    comparator_delay: float = 0.0
    crosstalk: float = 0.0

    @property
    def electrons_per_lux(self) -> float:
        """Photoelectrons a second for a lux on the pixel."""
        return self.chip.electrons_per_lux(photons_per_lux(self.wavelength_nm))

    def rate(self, lux: float) -> float:
        """Spikes a cycle (more than 1 saturates) under `lux` on the pixel."""
        return lux * self.electrons_per_lux * float(self.clock.period) / self.threshold

    @property
    def kept(self) -> tuple[Effect, ...]:
        """Every effect that acts in this setting."""
        made = list(self.effects)
        if self.reset != "residual":
            made = [e for e in made if e is not EFFECTS["residual carried"]]
        if self.threshold_noise > 0:
            made.append(threshold_noise_effect(self.threshold_noise))
        if self.dead_time > 0:
            made.append(dead_time_effect(self.dead_time * self.clock.hz))
        if self.row_skew > 0:
            made.append(row_sampling_effect(self.row_skew))
        if self.comparator_delay > 0:
            made.append(comparator_delay_effect(self.comparator_delay * self.clock.hz))
        if self.crosstalk > 0:
            made.append(crosstalk_effect(self.crosstalk))
        if self.pattern is not None:
            made += pattern_effects(self.pattern, float(self.clock.period))
        return tuple(made)

    @property
    def reach(self) -> tuple[int, int]:
        """Cycles before and after a block in which its light is needed as well."""
        return int(self.comparator_delay > 0), int(self.row_skew > 0)

    @property
    def model(self) -> ExactModel:
        return ExactModel(
            self.threshold,
            self.seed,
            self.effects,
            self.threshold_noise,
            self.reset,
            self.dead_time * self.clock.hz,
        )


def make_pixels(
    model: ExactModel, numbers: npt.NDArray[np.uint32], device: Device | None
) -> ExactPixels:
    """Pixels with these numbers on an OpenCL device, or compiled by numba when it is None."""
    if device is not None:
        from sensor.pixel.kernel import KernelPixels

        return KernelPixels(model, numbers, device)
    from sensor.pixel.compiled import CompiledPixels

    return CompiledPixels(model, numbers)


class SpikeCamera:
    """Exposes the chip's pixels to light. device: OpenCL, or None for numba; the bits are the same.

    rows: the rows of the chip that are simulated, all unless given; a pixel's number, and so its
    noise, is its place on the whole chip. Cross-talk takes the light beyond them to be as theirs.
    """

    def __init__(
        self,
        setting: CameraSetting,
        device: Device | None,
        rows: tuple[int, int] | None = None,
    ) -> None:
        chip = setting.chip
        first, stop = rows or (0, chip.height)
        self.shape = (stop - first, chip.width)
        self._clock = setting.clock
        numbers = np.arange(first * chip.width, stop * chip.width, dtype=np.uint32)
        pattern = None if setting.pattern is None else setting.pattern.at(numbers)
        offsets = None
        if setting.row_skew > 0 or setting.comparator_delay > 0:
            skew, delay = setting.row_skew, setting.comparator_delay
            offsets = row_offsets(setting.clock, chip.height, skew, delay, (first, stop))
        self._crosstalk = crosstalk_map(setting.crosstalk) if setting.crosstalk > 0 else None
        self._exposure = Exposure(setting.clock, setting.electrons_per_lux, pattern, offsets)
        self._pixels = make_pixels(setting.model, numbers, device)

    def step(self, light: Light, block: Block) -> Viform:
        """The latched flags of one block. light: lux on the pixels, at least this block's time and
        as many cycles around it as `CameraSetting.reach` says."""
        if light.shape != self.shape:
            raise ValueError(f"light must fall on {self.shape} pixels, not {light.shape}")
        if self._crosstalk is not None:
            light = self._crosstalk(light)
        spans = self._exposure.spans(light, block.start, block.cycles)
        words = self._pixels.expose(spans, block.cycles).reshape(-1, *self.shape)
        return Viform(words, block.cycles, self._clock, block.start)

    def state(self) -> dict[str, npt.NDArray[np.generic]]:
        """Everything the next block depends on."""
        now = self._pixels.state()
        return {"deficit": now.deficit, "spikes": now.spikes}

    def restore(self, state: dict[str, npt.NDArray[np.generic]]) -> None:
        """Go on from a `state`."""
        self._pixels.restore(
            PixelState(state["deficit"].astype(np.int64), state["spikes"].astype(np.uint64))
        )
