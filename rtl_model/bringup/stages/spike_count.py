"""How many spikes a pixel gives under constant light, in closed form: what the threshold sweep is
held against. Nothing of the cycle model stands in it."""

from __future__ import annotations

__all__ = ["count_spikes"]


def count_spikes(frames: int, electrons: int, level: int, rule: int) -> int:
    """Returns the spikes of one pixel in `frames` ticks from no charge.

    electrons: of one tick as the sensor counts them (twice those of 40 kHz at 20 kHz), 0 to 510.
    level: of the threshold, Q = 255 + 256 level. rule: 0 residual (3 as 0), 1 hard, 2 subtract.
    One spike a tick at most. A residual or subtracting pixel keeps what is beyond Q, so it has
    fired floor(n electrons / Q) times; a hard one is full every ceil(Q / electrons) ticks.
    """
    q = 255 + 256 * level
    if electrons <= 0:
        return 0
    if electrons >= q:
        return frames
    return frames // -(-q // electrons) if rule == 1 else frames * electrons // q
