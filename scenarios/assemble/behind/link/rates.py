"""The picture against the rate of the link, for every code, on a part of a run."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from cosim import SpikeStream, Viform
from cosim.report.drawn import Data, Value, write_figure
from cosim.report.figures import INK, LINE, subplots
from cosim.spikes.viform import WORD, words_for
from scenarios.assemble.behind.link.coding import Sender, of_a_part
from sensor.codec.packets.catalogue import KINDS
from sensor.codec.packets.section import CodeSection
from sensor.reconstruct.fidelity import psnr, to_white
from sensor.reconstruct.playback import tfp
from sensor.reconstruct.shots import Shot

RATES: Final = (0.1e9, 0.2e9, 0.5e9, 1e9, 2e9, 5e9, 10e9)
"""Rates of the link, for MEGAPIXEL pixels, bit/s."""
MEGAPIXEL: Final = 1_000_000
_COMPARED: Final = tuple(kind for kind in KINDS if kind != "event")
"""`event` has the spikes of first-spike in more bits: it is for a chip's wires."""
_SIDE, _CYCLES = 192, 512
"""Part of the stream: its side, pixels, and its length, cycles."""


@dataclass(frozen=True)
class RatePoint:
    """One code at one rate.

    Attributes:
        kind: the code.
        rate: rate of the link for a megapixel, bit/s.
        sent: bits of the packets that were sent, for a megapixel, bit/s.
        psnr: TFP of the decoded stream against the truth, dB; infinite if they are equal.
        dropped: share of the packets that were not sent.
    """

    kind: str
    rate: float
    sent: float
    psnr: float
    dropped: float


def _part(stream: SpikeStream, cycle: int) -> tuple[Viform, tuple[slice, slice], int]:
    """The middle of the picture around a cycle, from the first cycle of a word on; its rows and
    columns, and its first cycle."""
    height, width = stream.shape
    rows, columns = (
        slice((n - min(n, _SIDE)) // 2, (n - min(n, _SIDE)) // 2 + min(n, _SIDE))
        for n in (height, width)
    )
    latest = words_for(max(stream.cycles - _CYCLES, 0)) * WORD
    first = min(max(cycle - _CYCLES // 2, 0) // WORD * WORD, latest)
    count = min(_CYCLES, stream.cycles - first)
    words = stream.read_words(first // WORD, words_for(first + count))[:, rows, columns]
    part = Viform(np.ascontiguousarray(words), count, stream.clock, 0)
    return part, (rows, columns), first


def code_rates(
    stream: SpikeStream, shot: Shot, section: CodeSection, threshold: float, noise: float,
    window: int, white_rate: float,
) -> list[RatePoint]:  # fmt: skip
    """Codes a part of a stream at every rate; [] for a stream shorter than a word.

    Args:
        stream: stream that is sent.
        shot: truth at the instant that is compared.
        section: cycles, tile and buffer of the run's code.
        threshold, noise: threshold and noise of the pixels, electrons.
        window: window of TFP, cycles.
        white_rate: spikes a cycle of white.
    """
    if stream.cycles < WORD:
        return []
    part, place, first = _part(stream, shot.cycle)
    truth, clock = shot.truth[place], stream.clock
    share = part.shape[0] * part.shape[1] / MEGAPIXEL
    seconds = part.cycles / clock.hz
    points = []
    for kind in _COMPARED:
        one = CodeSection.model_validate({"kind": kind, "tile": section.tile}).model_copy(
            update={"cycles": section.cycles, "buffer": section.buffer}
        )
        one = of_a_part(one, clock)
        code = one.code(threshold, noise)
        for rate in RATES:
            control = one.control(clock.hz, rate * share)
            assert control is not None
            sender = Sender(code, part.shape, part.cycles, control)
            shown = sender.through(part)
            image = to_white(tfp(shown, shot.cycle - first, window), white_rate)
            count = sender.counts
            packets = sum(count.layers) + count.dropped
            points.append(
                RatePoint(
                    kind, rate, 8 * count.sent_bytes / seconds / share, psnr(image, truth),
                    count.dropped / max(packets, 1),
                )
            )  # fmt: skip
    return points


def rates_figure(points: Sequence[RatePoint], against: str, path: Path) -> Data:
    """Draws picture and packets left out against the rate. Returns the points. against: what the
    picture is compared with."""
    figure, axes = subplots(1, 2, figsize=(9, 3.4))
    for kind in dict.fromkeys(point.kind for point in points):
        mine = [point for point in points if point.kind == kind]
        rates = [point.rate / 1e9 for point in mine]
        known = [min(p.psnr, 60.0) if math.isfinite(p.psnr) else 60.0 for p in mine]
        axes[0].plot(rates, known, marker="o", markersize=3, label=kind)
        axes[1].plot(rates, [100 * p.dropped for p in mine], marker="o", markersize=3, label=kind)
    axes[0].set_ylabel(f"PSNR of TFP against {against}, dB")
    axes[1].set_ylabel("packets left out, %")
    for ax in axes:
        ax.set_xscale("log")
        ax.set_xlabel("rate of the link for a megapixel, Gbit/s")
        ax.grid(color=LINE, linewidth=0.5)
        ax.tick_params(colors=INK)
    axes[0].legend(fontsize=8)
    figure.tight_layout()
    write_figure(figure, path, 130)
    head = "code", "rate, Gbit/s", "PSNR, dB, at most 60", "packets left out, %"
    rows: list[tuple[Value, ...]] = [
        (p.kind, p.rate / 1e9, min(p.psnr, 60.0), 100 * p.dropped)
        for p in points
    ]  # fmt: skip
    return Data(head, rows)
