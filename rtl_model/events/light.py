"""Spikes for measurements and comparisons of the event path, and a receiver that is not always
ready."""

from __future__ import annotations

import numpy as np
from numba import njit

from cosim.spikes.viform import Words
from rtl_model.cycle import TILE, Tiles
from rtl_model.events.size import EventSize


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
