"""`python -m scenarios.studies.codes.delay STREAM [FIGURE]`: picture and delay of a stream over a
link against its rate, the cycles of a packet and the code, for docs/glass-over-light.md."""

from __future__ import annotations

import math
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from cosim import Viform
from cosim.report.figures import INK, LINE, subplots
from scenarios.assemble.behind.link.coding import Sender
from scenarios.assemble.behind.link.hold import PHASES, Stretch, choose_hold
from scenarios.studies.codes.ladder import fidelity, middle
from scenarios.studies.codes.tables import table
from sensor.codec.files import open_any
from sensor.codec.packets.section import CodeSection

RATES: Final = (0.5, 1.0, 2.0, 4.0, 6.0, 8.0)
"""Rates of the link for a megapixel at 40 kHz, Gbit/s."""
CYCLES: Final = (32, 64, 128, 256)
KINDS: Final = ("layered", "first-spike", "statistical", "raw")
LINK: Final = 24
"""Delay of the link of glass-over-light, cycles: its blocks of 8 cycles, assembly and readout."""
THRESHOLD: Final = 1000.0
MEGAPIXEL: Final = 1e6
COLOURS: Final = ("#d9480f", "#2f5fa8", "#3b8a4a", "#7a4fa3", "#a07a00", "#5a6472", "#c2559b")


@dataclass(frozen=True)
class Point:
    """A stream over a link of one rate.

    Attributes:
        kind, cycles, rate: code, cycles of a packet, and rate of the link, Gbit/s.
        delay: time from the latch of a spike until it is shown, ms.
        psnr: PSNR of TFP against that of the stream, dB; infinite if all is there.
    """

    kind: str
    cycles: int
    rate: float
    delay: float
    psnr: float


def point(stream: Viform, rate: float, **keys: Any) -> Point:
    """The stream, coded for a rate with some keys of [code]."""
    hz, share = stream.clock.hz, stream.shape[0] * stream.shape[1] / MEGAPIXEL
    carried = 1e9 * rate * share / hz
    stretch = Stretch(
        stream.shape, stream.cycles, stream.clock, THRESHOLD, 0.0,
        lambda first, cycles: stream.words[first // 32 : -(-(first + cycles) // 32)],
    )  # fmt: skip
    section, _ = choose_hold(CodeSection.model_validate(keys), stretch, carried)
    assert section.cycles is not None and section.buffer is not None
    control = section.control(hz, carried * hz)
    assert control is not None
    code = section.code(THRESHOLD, 0.0, PHASES)
    left = Sender(code, stream.shape, stream.cycles, control).through(stream)
    hold = section.cycles + math.ceil(round(section.buffer * hz, 6)) + LINK
    return Point(section.kind, section.cycles, rate, 1e3 * hold / hz, fidelity(left, stream))


def text(psnr: float) -> str:
    return f"{psnr:.1f}" if np.isfinite(psnr) else "exact"


def rows_of(points: list[Point]) -> list[list[str]]:
    """A row for each code and cycles, with picture and delay at each rate."""
    lines: dict[tuple[str, int], list[Point]] = {}
    for one in points:
        lines.setdefault((one.kind, one.cycles), []).append(one)
    return [
        [kind, str(cycles), *(f"{text(p.psnr)}, {p.delay:.1f}" for p in line)]
        for (kind, cycles), line in lines.items()
    ]


def draw(points: list[Point], aims: dict[str, list[Point]], path: Path) -> None:
    """PSNR over the rate by code and cycles, and over the delay for each aim."""
    figure, axes = subplots(1, 2, figsize=(12, 5))
    top = max(p.psnr for p in points if np.isfinite(p.psnr)) + 4
    lines = list(dict.fromkeys((p.kind, p.cycles) for p in points))
    for (kind, cycles), colour in zip(lines, COLOURS, strict=False):
        mine = [p for p in points if (p.kind, p.cycles) == (kind, cycles)]
        y = [min(p.psnr, top) for p in mine]
        style = "o-" if kind == "layered" else "s--"
        name = f"{kind}, packets of {cycles} cycles"
        axes[0].plot([p.rate for p in mine], y, style, color=colour, markersize=4, label=name)
    for (aim, mine), colour in zip(aims.items(), COLOURS, strict=False):
        y = [min(p.psnr, top) for p in mine]
        axes[1].plot([p.delay for p in mine], y, "o-", color=colour, label=f"code.aim = {aim}")
        for p, high in zip(mine, y, strict=True):
            axes[1].annotate(
                f"{p.rate:g}", (p.delay, high), (4, 4), textcoords="offset points", fontsize=8
            )
    axes[0].set_xlabel("rate of the link for 1 Mpx at 40 kHz, Gbit/s")
    axes[1].set_xlabel("hold, ms (Gbit/s at the points)")
    for ax in axes:
        ax.axhline(top, color=INK, linewidth=0.8)
        ax.annotate(
            "exact", (ax.get_xlim()[0], top), (4, 4), textcoords="offset points", fontsize=8
        )
        ax.set_ylim(None, top + 4)
        ax.set_ylabel("TFP against the stream's own, dB")
        ax.grid(color=LINE, linewidth=0.5)
        ax.legend(
            frameon=False, fontsize=8, ncols=2, loc="upper center", bbox_to_anchor=(0.5, -0.12)
        )
    figure.tight_layout()
    figure.savefig(path, dpi=110, format="png")


def main(arguments: list[str]) -> None:
    """Prints the tables, and draws the figure where one is named."""
    opened, _ = open_any(Path(arguments[0]), None)
    stream = middle(opened, 512)
    grid = [("layered", cycles) for cycles in CYCLES] + [(kind, 128) for kind in KINDS[1:]]
    points = [
        point(stream, rate, kind=kind, cycles=cycles) for kind, cycles in grid for rate in RATES
    ]
    aims = {aim: [point(stream, rate, aim=aim) for rate in RATES] for aim in ("picture", "delay")}
    head = [f"{rate:g} Gbit/s" for rate in RATES]
    print(table(["code", "cycles", *head], rows_of(points)))
    print(table(["code.aim", *head], [
        [aim, *(f"{text(p.psnr)}, {p.delay:.1f} ({p.cycles})" for p in line)]
        for aim, line in aims.items()
    ]))  # fmt: skip
    if len(arguments) > 1:
        draw(points, aims, Path(arguments[1]))


if __name__ == "__main__":
    main(sys.argv[1:])
