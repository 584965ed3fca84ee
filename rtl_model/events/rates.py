"""What an event path carries, measured on its cycle model: bits beside the raw stream, losses, and
the rate of spikes at which the queue overflows.

The spikes are those of pixels at steady light, and the receiver may not always be ready.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np
from numba import njit

from cosim.spikes.viform import Words
from rtl_model.cycle import TILE, Tiles
from rtl_model.events.encoder import EventEncoder, EventSize

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


def steady_words(
    size: EventSize, cycles: int, rate: float, spread: float, jitter: float, seed: int
) -> Words:
    """Words of pixels at steady light: each integrates its own rate plus noise, and fires at 1.

    Args:
        size: size of the array.
        cycles: a multiple of 32.
        rate: mean of the pixels, spikes a cycle.
        spread: pixels have rates of 1 - spread to 1 + spread times that.
        jitter: noise of a cycle's charge, uniform, as a share of the pixel's rate.
        seed: seed of rates, phases and noise.
    """
    rng = np.random.default_rng(seed)
    rates = rate * (1 + spread * rng.uniform(-1, 1, size.pixels))
    words = np.zeros((cycles // 32, size.pixels), np.uint32)
    _integrate(rates, rng.random(size.pixels), jitter, np.uint64(seed * 2 + 1), words)
    return words.reshape(-1, size.rows, size.columns)


def tiles_of(words: Words, size: EventSize, tick: int, first: int = 0, clock: int = 0) -> Tiles:
    """The tiles of a stream as the array of `viform_board` gives them.

    Args:
        words: (n, rows, columns) uint32.
        size: size of the array.
        tick: clocks of a frame, at least `size.tick_minimum`.
        first: number of the first frame.
        clock: edge of the first tile.
    """
    tiles = np.empty(32 * len(words) * size.rows * size.tiles, TILE)
    _scan(words, size.lanes, size.row_clocks, tick, first, clock, tiles)
    return tiles


@njit(cache=True, nogil=True)
def _integrate(rates, phase, jitter, noise, words):  # type: ignore[no-untyped-def]
    for p in range(words.shape[1]):
        charge, rate = phase[p], rates[p]
        for w in range(words.shape[0]):
            word = np.uint32(0)
            for b in range(32):
                noise ^= noise << np.uint64(13)  # xorshift64, Marsaglia 2003
                noise ^= noise >> np.uint64(7)
                noise ^= noise << np.uint64(17)
                charge += rate * (1 + jitter * (2 * (noise >> np.uint64(40)) / 16777216 - 1))
                if charge >= 1:
                    charge -= 1
                    word |= np.uint32(1 << b)
            words[w, p] = word


@njit(cache=True, nogil=True)
def _scan(words, lanes, row_clocks, tick, first, clock, tiles):  # type: ignore[no-untyped-def]
    n, rows, columns = words.shape
    row_tiles = -(-columns // lanes)
    for frame in range(32 * n):
        w, b = frame >> 5, np.uint32(frame & 31)
        for row in range(rows):
            for tile in range(row_tiles):
                bits = np.uint64(0)
                for lane in range(min(lanes, columns - tile * lanes)):
                    one = np.uint64((words[w, row, tile * lanes + lane] >> b) & np.uint32(1))
                    bits |= one << np.uint64(lane)
                to = (frame * rows + row) * row_tiles + tile
                tiles[to].clock = clock + frame * tick + row * row_clocks + tile
                tiles[to].frame = first + frame
                tiles[to].row, tiles[to].tile = row, tile
                tiles[to].bits = bits
