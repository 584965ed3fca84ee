"""Images of a latched stream at chosen instants, with the truth of the scene."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final, Protocol

import numpy as np
import numpy.typing as npt

from cosim import Clock, Plane, SpikeStream
from cosim.archive import save_array
from cosim.compute.stopping import threads
from cosim.files.atomic import atomic_write
from cosim.light.mosaic import Mosaic, delta_e, in_colour
from cosim.report.png import coloured, pictures_wanted, write_linear_png, write_png
from cosim.run.result import Latency, Metric
from sensor.reconstruct.fidelity import Estimate, Imaged, to_white
from sensor.reconstruct.intervals import interval_rate, isi
from sensor.reconstruct.playback import tfp, tfp_span
from sensor.reconstruct.readings import Dim, DimLight

_THREADS: Final = 2
"""Threads that make and encode images: each holds several planes."""
LATCHED: Final = ("tfp", "tfi")
"""Estimates of a latched stream."""


class Truth(Protocol):
    """What images are compared with: a scene, or what stands in its place."""

    def truth(self, ps: int) -> Plane:
        """Reflectance at an instant in picoseconds, (H, W) float32, white = 1."""
        ...


class Registers(Protocol):
    """Thresholds and windows of a run; see `sensor.latched.writes.Registers`."""

    def shares(self, first: int, stop: int) -> npt.NDArray[np.float64]: ...
    def rows(self, first: int, stop: int) -> tuple[int, int]: ...
    def untouched(self, cycle: int) -> tuple[int, int]: ...


@dataclass(frozen=True, eq=False)
class Shot:
    """One instant.

    Attributes:
        cycle: cycle of the instant.
        truth: reflectance, white = 1, (H, W).
        tfp, tfi: its estimates.
        tau: length of the interval that holds the instant, cycles, (H, W) int64; 0 for none.
        dim: pixels that are read below threshold or rejected as dark; None without either.
        white: spikes a cycle of white in the window of TFP.
        rows: (first, stop) rows that are read in all of that window.
    """

    cycle: int
    truth: Plane
    tfp: Estimate
    tfi: Estimate
    tau: npt.NDArray[np.int64]
    dim: Dim | None = None
    white: float = 1.0
    rows: tuple[int, int] = (0, 2**31)

    @property
    def read(self) -> Shot:
        """The instant on the rows that are read in all of its window."""
        part = slice(*self.rows)
        return replace(
            self, truth=self.truth[part], tfp=self.tfp[part], tfi=self.tfi[part], tau=self.tau[part]
        )


def take_shots(
    stream: SpikeStream,
    source: Truth,
    instants: list[int],
    window: int,
    white_rate: float,
    dim_light: DimLight | None = None,
    *,
    preceding: bool = False,
    registers: Registers | None = None,
) -> list[Shot]:
    """Images of these cycles, with the truth in the middle of each.

    The estimates are scaled by the spike rate of white: TFP by its mean over the window, TFI by
    that of the level at the instant, and from intervals between the writes around it alone. A row
    that is not read is black.

    Args:
        window, preceding: window of TFP, and whether it ends at the instant.
        white_rate: spikes a cycle of white, at the threshold of the setting.
        dim_light: how both estimates have dim pixels; None for from spikes alone.
        registers: thresholds and windows of a run with register writes; None without them.
    """

    def shot(cycle: int, truth: Plane, dim: Dim | None) -> Shot:
        tau = isi(stream, cycle, None if registers is None else registers.untouched(cycle))
        span = tfp_span(stream, cycle, window, preceding=preceding)
        rows = (0, stream.shape[0]) if registers is None else registers.rows(*span)
        white, now = (
            np.full(1, white_rate) if registers is None else white_rate * registers.shares(*cycles)
            for cycles in (span, (cycle, cycle + 1))
        )
        mean, instant = (
            to_white(rate if dim is None else dim.put(rate), scale)
            for rate, scale in (
                (tfp(stream, cycle, window, preceding=preceding), white),
                (interval_rate(tau) * (now > 0), now),
            )
        )  # fmt: skip
        return Shot(cycle, truth, mean, instant, tau, dim, float(np.max(white)), rows)

    with threads(_THREADS) as pool:
        parts = [
            pool.submit(
                shot, cycle, source.truth(stream.clock.middle(cycle)),
                None if dim_light is None else dim_light.at(stream, cycle),
            )
            for cycle in instants
        ]  # fmt: skip
        return [part.result() for part in parts]


def write_images(folder: Path, shots: Sequence[Imaged], methods: Sequence[str]) -> list[str]:
    """Writes truth and estimates of each instant, linear, 8-bit grey; and, as 8 bits round and cut
    it at white, the truth as floats too: truth-CYCLE.npy, (H, W) float32, white = 1. Returns their
    names in the folder; writes none if the run wants none."""
    if not pictures_wanted():
        return []
    if shots:
        (folder / "images").mkdir(exist_ok=True)
    pictures = {
        f"images/{method}-{shot.cycle:05d}.png": getattr(shot, method)
        for shot in shots
        for method in ("truth", *methods)
    }
    with threads(_THREADS) as pool:
        list(pool.map(write_linear_png, (folder / name for name in pictures), pictures.values()))
    floats = {f"images/truth-{shot.cycle:05d}.npy": shot.truth for shot in shots}
    for name, truth in floats.items():
        with atomic_write(folder / name) as part, part.open("wb") as file:
            save_array(file, np.asarray(truth, np.float32))
    return [*pictures, *floats]


def write_colour(folder: Path, shots: Sequence[Imaged], mosaic: Mosaic) -> list[str]:
    """Writes truth, TFP and TFI of each instant in colour, 8-bit sRGB. Returns their names; none if
    the run wants none."""
    names: list[str] = []
    if not pictures_wanted():
        return names
    for shot in shots:
        for method in ("truth", *LATCHED):
            names.append(f"images/colour-{method}-{shot.cycle:05d}.png")
            write_png(folder / names[-1], coloured(in_colour(mosaic, getattr(shot, method))))
    return names


def colour_differences(shots: Sequence[Imaged], mosaic: Mosaic) -> dict[str, Metric]:
    """Mean colour difference by method to the true light behind the same filters, its missing
    colours filled in the same way, over pixels and instants (CIE 1976)."""
    by_method: dict[str, list[float]] = {method: [] for method in LATCHED}
    for shot in shots:
        truth = in_colour(mosaic, shot.truth)
        for method, found in by_method.items():
            image = in_colour(mosaic, getattr(shot, method))
            found.append(float(delta_e(image, truth).mean()))
    return {f"{method}_delta_e": Metric(float(np.mean(v)), "1") for method, v in by_method.items()}


def interval_latency(clock: Clock, shots: list[Shot]) -> list[Latency]:
    """Length of the interval that an estimate is made from, over pixels and instants."""
    longest = max((int(shot.tau.max()) for shot in shots), default=0)
    if longest == 0:
        return []
    counts = sum(np.bincount(shot.tau.ravel(), minlength=longest + 1)[1:] for shot in shots)
    below, us = np.cumsum(counts), 1e6 / clock.hz
    n = int(below[-1])
    least, low, high = (  # at these places of the sorted lengths
        1 + int(np.searchsorted(below, place, side="right")) for place in (0, (n - 1) // 2, n // 2)
    )
    return [Latency("interval", least * us, (low + high) / 2 * us, longest * us)]


def spike_rate(stream: SpikeStream) -> float:
    """Spikes per pixel and cycle, over the whole stream."""
    chunk, words = 2, -(-stream.cycles // 32)
    total = sum(
        int(np.bitwise_count(stream.read_words(w, w + chunk)).sum(dtype=np.int64))
        for w in range(0, words, chunk)
    )
    return total / (stream.cycles * stream.shape[0] * stream.shape[1])
