"""Spike count of a pixel under constant light in closed form, independent of the cycle model."""

from __future__ import annotations


def count_spikes(frames: int, electrons: int, level: int, rule: int) -> int:
    """Spikes of one pixel that starts without charge.

    At most one spike a tick. With residual or subtracting reset, the charge beyond Q remains, so
    after n ticks the pixel has fired floor(n electrons / Q) times. With hard reset it fires every
    ceil(Q / electrons) ticks.

    Args:
        frames: number of ticks.
        electrons: electrons of one tick, 0 to 510; at 20 kHz twice those at 40 kHz.
        level: level of the threshold, Q = 255 + 256 level.
        rule: reset rule, 0 residual (also 3), 1 hard, 2 subtract.
    """
    q = 255 + 256 * level
    if electrons <= 0:
        return 0
    if electrons >= q:
        return frames
    return frames // -(-q // electrons) if rule == 1 else frames * electrons // q
