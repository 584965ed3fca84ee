"""The pixels of a plane in any tier: they turn light into words.

Modules of a tier are imported when that tier is chosen: they import numba or OpenCL, which would
slow the start of every command.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Literal, Protocol

import numpy as np
import numpy.typing as npt

from cosim.compute.opencl import Device
from cosim.light.light import Light
from sensor.device.pattern import FixedPattern
from sensor.latched.exposure import Exposure
from sensor.latched.pixel.charge import ONE, Charge
from sensor.latched.pixel.model import ExactModel, ExactPixels, PixelState
from sensor.latched.pixel.settling import settle
from sensor.latched.pixel.thresholds import thresholds
from sensor.latched.sampling import PixelTiming, RowMoves
from sensor.latched.setting import CameraSetting
from sensor.latched.written import RewrittenPixels, WrittenPixels

Tier = Literal["reference", "exact", "fast"]
Words = npt.NDArray[np.uint32]


def make_pixels(
    model: ExactModel, numbers: npt.NDArray[np.uint32], device: Device | None
) -> ExactPixels:
    """Pixels with these numbers on an OpenCL device, or compiled by numba if it is None."""
    if device is not None:
        from sensor.latched.pixel.kernel import KernelPixels

        return KernelPixels(model, numbers, device)
    from sensor.latched.pixel.compiled import CompiledPixels

    return CompiledPixels(model, numbers)


class TierPixels(Protocol):
    """Pixels of one tier, numbered by their place on the chip. Calls of `expose` follow each other
    without gaps; results do not depend on how a run is split into calls."""

    def expose(self, light: Light, start: int, cycles: int) -> Words: ...
    def fraction(self) -> npt.NDArray[np.float64]: ...
    def state(self) -> dict[str, npt.NDArray[Any]]: ...
    def restore(self, state: dict[str, npt.NDArray[Any]]) -> None: ...


class _Exact:
    """Pixels of the exact tier, including the integration of light."""

    def __init__(
        self,
        setting: CameraSetting,
        numbers: npt.NDArray[np.uint32],
        pattern: FixedPattern | None,
        offsets: npt.NDArray[np.int64] | None,
        moves: RowMoves | None,
        timing: PixelTiming | None,
        device: Device | None,
    ) -> None:
        self._model, self._numbers = setting.model, numbers
        self._exposure = Exposure(
            setting.clock, setting.electrons_per_lux, pattern, offsets, moves, timing,
            self._model.transfers,
        )  # fmt: skip
        self._pixels = make_pixels(self._model, numbers, device)

    def expose(self, light: Light, start: int, cycles: int) -> Words:
        return self._pixels.expose(self._exposure.each(light, start, cycles), cycles)

    def _running(self, spikes: npt.NDArray[np.uint64]) -> Charge:
        """Threshold of the current interval, (n,) Q24.40. That of the first interval has another
        distribution."""
        model = self._model
        if not model.noisy:
            return np.full(spikes.shape, model.q, np.int64)
        later = thresholds(model.table(), spikes, self._numbers, model.seed)
        return np.where(spikes == 0, model.first_thresholds(self._numbers), later)

    def fraction(self) -> npt.NDArray[np.float64]:
        """Stored charge over the threshold of the current interval."""
        now = self._pixels.state()
        return 1 - (now.deficit + 1) / np.maximum(self._running(now.spikes), ONE // 1024)

    def take_over(
        self, before: _Exact, cycle: int, fresh: npt.NDArray[np.bool_], interval: int
    ) -> npt.NDArray[np.bool_] | None:
        """Continues the pixels of another threshold; see `RewrittenPixels`."""
        old, model = before._pixels.state(), self._model
        charge = np.where(fresh, 0, before._running(old.spikes) - old.deficit - 1)
        spikes = np.where(fresh, np.uint64(interval), old.spikes)
        deficit = self._running(spikes) - charge - 1
        fires = None
        if model.reset == "residual" and not model.dead:

            def draw(k: npt.NDArray[np.uint64], due: npt.NDArray[np.bool_]) -> Charge | int:
                if not model.noisy:
                    return model.q
                return thresholds(model.table(), k, self._numbers[due], model.seed)

            fires = settle(deficit, spikes, model.q, draw)
        self._exposure = before._exposure
        self._pixels.restore(PixelState(deficit, spikes))
        return fires

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
    row_delay: npt.NDArray[np.int64] | None = None,
    like: TierPixels | None = None,
) -> TierPixels:
    """Pixels of a plane in one tier. The map of the light (cross-talk) is not applied here.

    Args:
        tier: arithmetic of the pixels.
        setting: setting of the camera.
        shape: (H, W) of the plane.
        numbers: (H W,) uint32, numbers of the pixels on the chip.
        rows: (H,) int64, row of the chip of each row of the plane.
        device: OpenCL device, or None for numba. The fast tier requires OpenCL.
        flags: effects that each group of pixels keeps in the fast tier; see `PixelArray`. The
            reference keeps all effects, and takes thresholds from the bank where they say so. The
            exact tier ignores them.
        row_delay: (height of the chip,) int64 ps; see `SpikeCamera`.
        like: pixels that differ in their seed only, whose constants may be shared; None for none.

    Raises:
        ValueError: the fast tier has no device, or `row_delay` has another shape.
    """

    def make(threshold: float) -> RewrittenPixels:
        level = replace(setting, threshold=threshold, writes=())
        same = None if setting.writes else like
        return _level_pixels(tier, level, shape, numbers, rows, device, flags, row_delay, same)

    if not setting.writes:
        return make(setting.threshold)
    return WrittenPixels(setting.phases, make, np.repeat(rows, shape[1]))


def _level_pixels(
    tier: Tier,
    setting: CameraSetting,
    shape: tuple[int, int],
    numbers: npt.NDArray[np.uint32],
    rows: npt.NDArray[np.int64],
    device: Device | None,
    flags: npt.NDArray[np.uint8] | None,
    row_delay: npt.NDArray[np.int64] | None,
    like: TierPixels | None,
) -> Any:
    """Pixels whose registers are not written; the arguments are those of `tier_pixels`."""
    offsets = setting.sampling_offsets
    if offsets is not None:
        offsets = offsets[rows]
    if row_delay is not None:
        if row_delay.shape != (setting.chip.height,):
            raise ValueError(f"row_delay must be ({setting.chip.height},), not {row_delay.shape}")
        offsets = (0 if offsets is None else offsets) - row_delay[rows].astype(np.int64)
    moves = None if setting.clock_moves is None else setting.clock_moves.on(rows.size)
    timing = None
    if setting.row_timing is not None:
        timing = setting.row_timing.on(numbers, rows, setting.chip.height, setting.seed)
    if tier == "fast":
        from sensor.latched.fast import FastPixels, PixelArray

        if device is None:
            raise ValueError("the fast tier needs an OpenCL device")
        if isinstance(like, FastPixels):
            return FastPixels(like.array.seeded(setting.model, timing), device, like)
    lumped = tier != "reference" or setting.circuit is None
    pattern = setting.fixed_pattern(numbers, lumped=lumped)
    gain, model = setting.electrons_per_lux, setting.model
    if tier == "exact":
        return _Exact(setting, numbers, pattern, offsets, moves, timing, device)
    if tier == "fast":
        assert device is not None
        array = PixelArray(
            model, shape, numbers, setting.clock, gain, pattern, offsets, flags, moves, timing
        )
        return FastPixels(array, device)
    from sensor.latched.reference import ReferencePixels

    each = None if offsets is None else np.repeat(offsets, shape[1])
    if setting.circuit is not None:  # the circuit itself takes the place of its lumped form
        model = replace(model, dead_time=0.0, shift=0.0)
    overshoot = 0.0 if lumped else setting.overshoot
    bank = None
    if flags is not None:
        from sensor.latched.fast.units import BANK, NOISE
        from sensor.latched.reference.bank_draws import bank_draws

        groups = (flags & (BANK | NOISE)) == BANK | NOISE
        bank = bank_draws(model, numbers, shape, groups)
    return ReferencePixels(
        model, numbers, setting.clock, gain, pattern, each, setting.circuit, overshoot, moves, bank,
        timing,
    )  # fmt: skip
