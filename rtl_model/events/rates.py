"""What an event path carries, measured on its cycle model: bits beside the raw stream, losses, and
the rate of spikes at which the queue overflows."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from rtl_model.events.encoder import EventEncoder
from rtl_model.events.light import steady_words, tiles_of
from rtl_model.events.size import EventSize

THRESHOLD: Final = 1000.0
"""Electrons of a spike."""
SPREAD: Final = 0.5
"""Pixels have 1 - SPREAD to 1 + SPREAD times the mean rate."""
_STEPS: Final = 8
"""Halvings of the search for the overflow, between 0 and 1 spike a cycle: to 1/256."""
_SEARCHED: Final = 12
"""Packets of each trial of the search."""


class Carried(NamedTuple):
    """A path at one rate, its receiver always ready.

    Attributes:
        rate: spikes a pixel and cycle.
        sent: first spikes and closing ones that were sent, over spikes.
        bits: bits of all words, a pixel and cycle; the raw stream has 1.
        lost: share of the spikes that found no room.
    """

    rate: float
    sent: float
    bits: float
    lost: float


def measure(size: EventSize, rate: float, tick: int, packets: int = 24, seed: int = 1) -> Carried:
    """Runs a path at steady light with shot noise.

    The charge of a cycle has the variance of rate * THRESHOLD electrons (Poisson): relative to its
    mean, 1 / (rate * THRESHOLD). A uniform deviation of up to j has j^2 / 3.

    Args:
        size: size of the path.
        rate: mean spikes a pixel and cycle, above 0.
        tick: clocks of a cycle.
        packets: length of the run, the first packet included.
        seed: seed of the light.
    """
    cycles = packets * size.cycles
    jitter = math.sqrt(3 / (rate * THRESHOLD))
    words = steady_words(size, cycles, rate, SPREAD, jitter, seed)
    encoder = EventEncoder(size)
    out = encoder.run(tiles_of(words, size, tick), np.ones(cycles * tick, np.uint8))
    # The last packet is still open, so whole packets are counted, in their cycles.
    whole = int(np.append(0, np.flatnonzero(out["last"]) + 1)[-1])
    done = max(int(out["last"].sum()), 1) * size.cycles
    spikes = int(np.bitwise_count(words).sum(dtype=np.int64))
    pixel_cycles = size.pixels * done
    events = int((_body(out["data"][:whole], out["last"][:whole]) >> 15).sum())
    per = spikes / (size.pixels * cycles)
    return Carried(
        per, events / max(per * pixel_cycles, 1), 16 * whole / pixel_cycles,
        encoder.lost_spikes / max(spikes, 1),
    )  # fmt: skip


def _body(data: np.ndarray, last: np.ndarray) -> np.ndarray:
    """Words of packets without heads (six words) and checksums (two)."""
    ends = np.flatnonzero(last) + 1
    begins = np.append(0, ends[:-1])
    keep = np.ones(len(data), bool)
    for n in range(6):
        keep[begins + n] = False
    for n in (1, 2):
        keep[ends - n] = False
    return data[keep]


def most_rate(size: EventSize, tick: int) -> float:
    """Largest rate, spikes a pixel and cycle, at which no spike is lost; 0 for none."""
    low, high = 0.0, 1.0
    for _ in range(_STEPS):
        rate = (low + high) / 2
        if measure(size, rate, tick, _SEARCHED).lost:
            high = rate
        else:
            low = rate
    return low
