"""`viform bench events`: what the event path of a board carries, on its cycle model.

It generates the tables of docs/event-path.md: bits a pixel and cycle beside the raw stream's one,
spikes that are lost, and the rate at which the queue overflows.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

from cosim.report.figures import subplots
from rtl_model.events.encoder import EventSize
from rtl_model.events.rates import measure, most_rate

CLOCK_HZ: Final = 48_000_000
"""Clock of the board (`Geometry`)."""
LATCH_HZ: Final = 40_000
"""Cycles a second of the chip."""
RATES: Final = (0.002, 0.005, 0.01, 0.02, 0.034, 0.05, 0.1, 0.2, 0.3, 0.6)
"""Spikes a pixel and cycle."""
SIZES: Final = (
    EventSize(32, 32, depth=256),
    EventSize(64, 64, depth=512),
    EventSize(128, 128, depth=4096),
)


@dataclass(frozen=True)
class EventsRow:
    """A path at one rate; see `Carried`."""

    pixels: str
    rate: float
    sent: float
    bits: float
    lost: float


@dataclass(frozen=True)
class Limit:
    """A path's largest rate without a loss.

    Attributes:
        pixels: rows x columns.
        depth: entries of the queue.
        tick: clocks of a cycle.
        rate: spikes a pixel and cycle.
    """

    pixels: str
    depth: int
    tick: int
    rate: float


def _tick(size: EventSize) -> int:
    return max(CLOCK_HZ // LATCH_HZ, size.tick_minimum)


def bench_events() -> dict[str, Any]:
    """The document: {clock_hz, latch_hz, rows [`EventsRow`], limits [`Limit`]}."""
    rows, limits = [], []
    for size in SIZES:
        name, tick = f"{size.rows} x {size.columns}", _tick(size)
        for rate in RATES:
            got = measure(size, rate, tick)
            rows.append(asdict(EventsRow(name, got.rate, got.sent, got.bits, got.lost)))
        limits.append(asdict(Limit(name, size.depth, tick, most_rate(size, tick))))
    return {"clock_hz": CLOCK_HZ, "latch_hz": LATCH_HZ, "rows": rows, "limits": limits}


def markdown(document: dict[str, Any]) -> str:
    """The tables as text."""
    lines = [
        "| pixels | spikes a pixel and cycle | events a spike | bits a pixel and cycle | lost |",
        "|---|---|---|---|---|",
    ]
    lines += [
        f"| {r['pixels']} | {r['rate']:.4f} | {r['sent']:.2f} | {r['bits']:.3f} "
        f"| {100 * r['lost']:.1f} % |"
        for r in document["rows"]
    ]
    lines += ["", "| pixels | queue | clocks a cycle | without a loss up to |", "|---|---|---|---|"]
    lines += [
        f"| {r['pixels']} | {r['depth']} | {r['tick']} | {r['rate']:.3f} |"
        for r in document["limits"]
    ]
    return "\n".join(lines)


def draw(document: dict[str, Any], path: Path) -> None:
    """Draws bits and losses against the rate, as a PNG."""
    figure, axes = subplots(1, 2, figsize=(9, 3.4))
    for name in dict.fromkeys(row["pixels"] for row in document["rows"]):
        mine = [row for row in document["rows"] if row["pixels"] == name]
        rates = [row["rate"] for row in mine]
        axes[0].plot(rates, [row["bits"] for row in mine], marker="o", markersize=3, label=name)
        lost = [100 * row["lost"] for row in mine]
        axes[1].plot(rates, lost, marker="o", markersize=3, label=name)
    axes[0].axhline(1, color="0.5", linewidth=1)
    axes[0].text(RATES[0], 1.1, "raw", color="0.4")
    axes[0].set_yscale("log")
    axes[0].set_ylabel("bits a pixel and cycle")
    axes[1].set_ylabel("spikes lost, %")
    for ax in axes:
        ax.set_xscale("log")
        ax.set_xlabel("spikes a pixel and cycle")
        ax.legend()
    figure.tight_layout()
    figure.savefig(path, format="png")
