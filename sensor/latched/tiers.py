"""The pixels of a plane in any tier: light in, words out, whatever arithmetic is in between."""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Literal, Protocol

import numpy as np
import numpy.typing as npt

from cosim.compute.opencl import Device
from cosim.light.light import Light
from sensor.device.pattern import FixedPattern
from sensor.latched.exposure import Exposure
from sensor.latched.pixel.fixed_point import ONE
from sensor.latched.pixel.model import ExactModel, ExactPixels, PixelState
from sensor.latched.pixel.thresholds import thresholds
from sensor.latched.setting import CameraSetting

__all__ = ["Tier", "TierPixels", "make_pixels", "tier_pixels"]

Tier = Literal["reference", "exact", "fast"]
Words = npt.NDArray[np.uint32]


def make_pixels(
    model: ExactModel, numbers: npt.NDArray[np.uint32], device: Device | None
) -> ExactPixels:
    """Pixels with these numbers on an OpenCL device, or compiled by numba when it is None."""
    if device is not None:
        from sensor.latched.pixel.kernel import KernelPixels

        return KernelPixels(model, numbers, device)
    from sensor.latched.pixel.compiled import CompiledPixels

    return CompiledPixels(model, numbers)


class TierPixels(Protocol):
    """Pixels of one tier, numbered by their place on the chip. Calls follow each other without
    gaps; no result depends on how a run is split."""

    def expose(self, light: Light, start: int, cycles: int) -> Words: ...
    def fraction(self) -> npt.NDArray[np.float64]: ...
    def state(self) -> dict[str, npt.NDArray[Any]]: ...
    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None: ...


class _Exact:
    """The exact tier, with the light's integration in it."""

    def __init__(
        self,
        setting: CameraSetting,
        numbers: npt.NDArray[np.uint32],
        pattern: FixedPattern | None,
        offsets: npt.NDArray[np.int64] | None,
        device: Device | None,
    ) -> None:
        self._model, self._numbers = setting.model, numbers
        self._exposure = Exposure(setting.clock, setting.electrons_per_lux, pattern, offsets)
        self._pixels = make_pixels(self._model, numbers, device)

    def expose(self, light: Light, start: int, cycles: int) -> Words:
        return self._pixels.expose(self._exposure.each(light, start, cycles), cycles)

    def fraction(self) -> npt.NDArray[np.float64]:
        """Stored charge over the running interval's own threshold. That of the first interval is
        drawn from a law of its own."""
        now, model = self._pixels.state(), self._model
        running = np.full(now.deficit.shape, model.q, np.int64)
        if model.noisy:
            later = thresholds(model.table(), now.spikes, self._numbers, model.seed)
            running = np.where(now.spikes == 0, model.first_thresholds(self._numbers), later)
        return 1 - (now.deficit + 1) / np.maximum(running, ONE // 1024)

    def state(self) -> dict[str, npt.NDArray[Any]]:
        now = self._pixels.state()
        return {"deficit": now.deficit, "spikes": now.spikes}

    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None:
        self._pixels.restore(
            PixelState(state["deficit"].astype(np.int64), state["spikes"].astype(np.uint64))
        )


def tier_pixels(
    tier: Tier,
    setting: CameraSetting,
    shape: tuple[int, int],
    numbers: npt.NDArray[np.uint32],
    rows: npt.NDArray[np.int64],
    device: Device | None = None,
    flags: npt.NDArray[np.uint8] | None = None,
    late: npt.NDArray[np.int64] | None = None,
) -> TierPixels:
    """Pixels of a plane of `shape`. numbers: of each on the chip, (H W,). rows: of the chip that
    each row of the plane is, (H,). device: OpenCL; None is numba, which the fast tier has not.
    flags: which work-items of the fast tier keep what (`sensor.fast`), all of it unless given.
    late: of the chip's rows, (height of the chip,) ps; see `SpikeCamera`. Cross-talk is the light's
    and not done here."""
    offsets = setting.sampling_offsets
    if offsets is not None:
        offsets = offsets[rows]
    if late is not None:
        if late.shape != (setting.chip.height,):
            raise ValueError(f"late must be ({setting.chip.height},), not {late.shape}")
        offsets = (0 if offsets is None else offsets) - late[rows].astype(np.int64)
    pattern = setting.fixed_pattern(numbers, lumped=tier != "reference")
    gain, model = setting.electrons_per_lux, setting.model
    if tier == "exact":
        return _Exact(setting, numbers, pattern, offsets, device)
    if tier == "fast":
        from sensor.latched.fast import FastPixels, PixelArray

        if device is None:
            raise ValueError("the fast tier needs an OpenCL device")
        array = PixelArray(model, shape, numbers, setting.clock, gain, pattern, offsets, flags)
        return FastPixels(array, device)
    from sensor.latched.reference import ReferencePixels

    each = None if offsets is None else np.repeat(offsets, shape[1])
    if setting.circuit is not None:  # as it is, not lumped
        model = replace(model, dead_time=0.0, shift=0.0)
    return ReferencePixels(
        model, numbers, setting.clock, gain, pattern, each, setting.circuit, setting.overshoot
    )
