"""`python -m scenarios.studies.codes.ladder STREAM [FIGURE]`: the ladder of the layered code beside
the statistical code, and its speed, for the figures of docs/stream-code.md."""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cosim import SpikeStream, Viform
from cosim.report.figures import subplots
from cosim.spikes.viform import words_for
from scenarios.studies.codes.tables import table
from sensor import tfp
from sensor.codec import Code, recode
from sensor.codec.files import open_any
from sensor.codec.packets.catalogue import StreamCode
from sensor.codec.packets.coder import from_packets, size_of, to_packets
from sensor.codec.packets.layered import LAYERS
from sensor.codec.size import coded_size

WINDOW = 41
SIDE = 512
"""Side of the part in the middle of a stream that is measured, pixels."""
CYCLES = 1024
GBITS = 1e6 * 40e3 / 1e9
"""Gbit/s of one bit a pixel and cycle, of a megapixel at 40 kHz."""
KS = (1.5, 2.0, 3.0, 5.0, 8.0)


@dataclass(frozen=True)
class Rung:
    """A size and what it keeps.

    Attributes:
        name: name of the code and its setting.
        size: bits per pixel and cycle, with all headers.
        psnr: PSNR of TFP against that of the stream, dB; infinite if all is there.
    """

    name: str
    size: float
    psnr: float


def middle(stream: SpikeStream, most: int = CYCLES) -> Viform:
    """SIDE x SIDE pixels in the middle of a stream, its first `most` cycles."""
    cycles = min(stream.cycles // 32 * 32, most)
    words = stream.read_words(0, words_for(cycles))
    y, x = (max(n - SIDE, 0) // 2 for n in stream.shape)
    part = np.ascontiguousarray(words[:, y : y + SIDE, x : x + SIDE])
    return Viform(part, cycles, stream.clock)


def fidelity(left: Viform, stream: Viform) -> float:
    """PSNR of TFP (41 cycles, peak one spike a cycle) against that of the stream, mean of the
    squared errors of nine instants."""
    errors = [
        float(np.mean((tfp(left, at, WINDOW) - tfp(stream, at, WINDOW)) ** 2))
        for at in np.linspace(WINDOW, stream.cycles - WINDOW, 9).astype(int)
    ]
    return float(-10 * np.log10(np.mean(errors))) if any(errors) else float("inf")


def ladder(stream: Viform, cycles: int) -> list[Rung]:
    """The rungs of the layered code, coarse to fine."""
    code, rungs = StreamCode(cycles=cycles), []
    packets = to_packets(stream, code)
    for layers in range(1, LAYERS + 1):
        sent = [packet for packet in packets if packet.layer < layers]
        left = from_packets(sent, stream, code)
        name = f"layered, {cycles} cycles, layers 0-{layers - 1}"
        rungs.append(Rung(name, size_of(sent, stream), fidelity(left, stream)))
    return rungs


def statistical(stream: Viform, threshold: float) -> list[Rung]:
    """The statistical code of files, for some k, with and without means of 8."""
    rungs = []
    for refine in (0, 8):
        for k in KS:
            code = Code("statistical", k, threshold, refine=refine)
            name = f"statistical, k = {k:g}" + (", means of 8" if refine else "")
            size, _ = coded_size(stream, code)
            rungs.append(Rung(name, size, fidelity(recode(stream, code), stream)))
    return rungs


def speed(stream: Viform, cycles: int, turns: int = 5) -> list[list[str]]:
    """Rows of (what, pixel-cycles/s, core-ns a pixel-cycle), the best of some turns."""
    code, pixels = StreamCode(cycles=cycles), stream.words.size * 32
    best: dict[str, tuple[float, float]] = {}
    packets = to_packets(stream, code)
    for _ in range(turns):
        for name, call in (
            ("coding", lambda: to_packets(stream, code)),
            ("decoding", lambda: from_packets(packets, stream, code)),
        ):
            wall, spent = time.perf_counter(), time.process_time()
            call()
            now = time.perf_counter() - wall, time.process_time() - spent
            before = best.get(name, now)
            best[name] = min(before[0], now[0]), min(before[1], now[1])
    return [
        [f"{name}, {cycles} cycles", f"{pixels / wall:.3g}", f"{1e9 * spent / pixels:.2f}"]
        for name, (wall, spent) in best.items()
    ]


def draw(rungs: dict[str, list[Rung]], path: Path) -> None:
    """PSNR over Gbit/s of a megapixel. The statistical code has no sizes between its points: k
    takes it from one group of them to the other."""
    figure, ax = subplots(figsize=(8, 4.6))
    finite = [r.psnr for line in rungs.values() for r in line if np.isfinite(r.psnr)]
    top = max(finite) + 4
    for (name, line), colour in zip(
        rungs.items(), ("#2f5fa8", "#9db4d8", "#e8a07f", "#d9480f"), strict=True
    ):
        x = [GBITS * r.size for r in line]
        y = [min(r.psnr, top) for r in line]
        ax.plot(x, y, "o-" if "layered" in name else "s", color=colour, label=name)
    ax.axhline(top, color="#1d2433", linewidth=0.8)
    ax.annotate("lossless", (0.011, top), (0, 4), textcoords="offset points", fontsize=9)
    ax.set_xscale("log")
    ax.set_ylim(None, top + 4)
    ax.set_xlabel("Gbit/s of 1 Mpx at 40 kHz")
    ax.set_ylabel("TFP against the stream's own, dB")
    ax.grid(color="#c8ccd4", linewidth=0.5)
    ax.spines[["top", "right"]].set_visible(False)
    ax.legend(frameon=False, fontsize=9, loc="lower right")
    figure.tight_layout()
    figure.savefig(path, dpi=110, format="png")


def main(arguments: list[str]) -> None:
    """Prints the tables, and draws the figure where one is named."""
    opened, _ = open_any(Path(arguments[0]), None)
    stream = middle(opened)
    lossy = statistical(stream, 1000.0)
    rungs = {
        "layered, packets of 128 cycles": ladder(stream, 128),
        "layered, packets of 512 cycles": ladder(stream, 512),
        "statistical": lossy[: len(KS)],
        "statistical, means of 8": lossy[len(KS) :],
    }
    spikes = int(np.bitwise_count(stream.words).sum(dtype=np.int64))
    print(f"{spikes / (32 * stream.words.size):.3f} spikes a cycle\n")
    rows = [
        [r.name, f"{r.size:.4f}", f"{GBITS * r.size:.2f}", f"{r.psnr:.1f}"]
        for line in rungs.values() for r in line
    ]  # fmt: skip
    print(table(["code", "bit/pixel-cycle", "Gbit/s", "dB"], rows))
    timed = speed(stream, 128) + speed(stream, 512)
    print(table(["", "pixel-cycles/s", "core-ns/pixel-cycle"], timed))
    if len(arguments) > 1:
        draw(rungs, Path(arguments[1]))


if __name__ == "__main__":
    main(sys.argv[1:])
