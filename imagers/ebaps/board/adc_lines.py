"""Data lines of the converter and their alignment at the FPGA.

Document 002, section 2: the converter (16 bits, 80 MS/s) drives 16 parallel lines, and the FPGA
aligns them against a test pattern before it takes pictures. It prints nothing about the method.
Assumed: the lines differ in delay (skew), and the sampling clock falls anywhere in a bit. The FPGA
sets the sampling instant of each line in 160 steps of 78.125 ps, which are a bit of 12.5 ns: five
phases of the clock, 2.5 ns apart, and 32 taps of a delay (1/64 of a period of 200 MHz, as in common
FPGAs). The pattern is PN9, the test pattern of such converters (ITU-T O.150, x^9 + x^5 + 1).

    bit alignment   every position is sampled; the error-free ones with one word phase are the eye,
                    and the middle of the eye is taken
    word alignment  a line that is sampled a bit later than another is delayed by a bit (bitslip)

Errors: edges of the data are displaced against the clock by a normal jitter, independently. A
sample at the offset x from the middle of a bit T reads the neighbouring bit if an edge passes it:

    p(x) = r (Q((T/2 + x)/s) + Q((T/2 - x)/s)),   r: share of bits that differ from a neighbour.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
import numpy.typing as npt
from scipy.special import ndtr

from cosim.clock import PS
from cosim.compute.draws import normal
from cosim.compute.streams import Stream

SAMPLE_HZ: Final = 80_000_000
"""Samples a second of the converter: document 002, section 2."""
LINES: Final = 16
"""Parallel data lines: document 002, section 3."""
BIT_PS: Final = PS // SAMPLE_HZ
TAP_PS: Final = PS / (64 * 200_000_000)
"""A step of the sampling instant: assumed."""
POSITIONS: Final = round(BIT_PS / TAP_PS)
"""Steps in a bit."""
PATTERN_WORDS: Final = 511
"""Words of the pattern that each position is tested with: one period of PN9."""
SLIPS: Final = range(-1, 4)
"""Bits by which a line may be late."""
_PADDING: Final = 8
"""Samples before and after a frame; the converter does not stop."""
_REACH: Final = 8.7
"""Standard deviations that no draw exceeds: sqrt(-2 ln 2^-54) = 8.65."""
_TRAINING: Final = 1 << 40
"""Number of the frame of the training's draws, beyond those of frames."""

Words = npt.NDArray[np.uint16]
Bits = npt.NDArray[np.uint8]
Values = npt.NDArray[np.float64]


def pn9(count: int) -> Words:
    """`count` words of the pattern, first bit in bit 15; it begins with nine ones."""
    bits = np.ones(LINES * count, np.uint8)
    for n in range(9, bits.size):
        bits[n] = bits[n - 9] ^ bits[n - 5]
    weights = 1 << np.arange(LINES - 1, -1, -1)
    return (bits.reshape(count, LINES) * weights).sum(axis=1).astype(np.uint16)


def error_rate(offset: float, jitter: float, density: float = 0.5) -> float:
    """Probability that a sample reads another bit.

    Args:
        offset: offset of the sampling instant from the middle of the bit, ps.
        jitter: standard deviation of the edges, ps.
        density: share of bits that differ from the neighbour on one side: 1/2 for random data.
    """
    if jitter <= 0:
        return 0.0 if abs(offset) < BIT_PS / 2 else density
    sides = (BIT_PS / 2 + offset, BIT_PS / 2 - offset)
    return float(density * sum(ndtr(-side / jitter) for side in sides))


@dataclass(frozen=True, eq=False)
class Alignment:
    """Settings of the lines, (16,) each.

    Attributes:
        positions: positions of the sampling instant, steps.
        slips: bits by which the line is late, which the bitslip takes away.
        eyes: width of the error-free eye, ps; 0 if none was found.
    """

    positions: npt.NDArray[np.int64]
    slips: npt.NDArray[np.int64]
    eyes: Values

    @property
    def found(self) -> bool:
        """Whether every line has an eye."""
        return bool((self.eyes > 0).all())


@dataclass(frozen=True)
class AdcLines:
    """The lines of one board.

    Attributes:
        jitter: standard deviation of an edge of the data against the sampling clock, ps.
        skew: largest difference of a line's delay from the mean, ps.
        device: seed of the delays.
    """

    jitter: float
    skew: float
    device: int = 1

    @cached_property
    def instants(self) -> Values:
        """(16,) ps from the beginning of a line's bit to the sampling instant at position 0: the
        phase of the clock, uniform over a bit, less the delay of the line."""
        numbers = np.arange(LINES + 1)
        share = ndtr(normal(numbers, 0, self.device, Stream.IMAGER_LINES))
        return np.asarray(share[-1] * BIT_PS - self.skew * (2 * share[:-1] - 1))

    def _sampled(self, positions: npt.NDArray[np.int64]) -> tuple[npt.NDArray[np.int64], Values]:
        """Bits by which each line is late, and the instant within the bit, ps."""
        instants = self.instants + positions * TAP_PS
        late = np.floor(instants / BIT_PS).astype(np.int64)
        return late, instants - late * BIT_PS

    def registered(
        self, words: Words, positions: npt.NDArray[np.int64], draw: int, seed: int
    ) -> Bits:
        """(16, n - 16) bits that the FPGA's input registers hold, for n words on the lines, the
        first and last 8 left out; line i is bit i."""
        bits = (words[None, :] >> np.arange(LINES, dtype=np.uint16)[:, None] & 1).astype(np.uint8)
        late, within = self._sampled(positions)
        count = words.size - 2 * _PADDING
        out = np.empty((LINES, count), np.uint8)
        edges = np.arange(count + 1)
        for line in range(LINES):
            first = _PADDING + int(late[line])
            here, before, after = (bits[line, first + n :][:count] for n in (0, -1, 1))
            at = float(within[line])
            out[line] = here
            if min(at, BIT_PS - at) > _REACH * self.jitter:
                continue
            # An edge belongs to the samples on both of its sides.
            numbers = line * (words.size + 1) + first + edges
            moved = self.jitter * normal(numbers, draw, seed, Stream.IMAGER_LINES)
            out[line] = np.where(at < moved[:-1], before, here)
            out[line] = np.where(at >= BIT_PS + moved[1:], after, out[line])
        return out

    def train(self, seed: int) -> Alignment:
        """Finds the eye and the word phase of every line. A line without an error-free position
        keeps position 0 and its smallest number of errors."""
        sent = pn9(PATTERN_WORDS + 2 * _PADDING)
        wanted = (sent[None, :] >> np.arange(LINES, dtype=np.uint16)[:, None] & 1).astype(np.uint8)
        errors = np.empty((POSITIONS, LINES, len(SLIPS)), np.int64)
        for position in range(POSITIONS):
            got = self.registered(sent, np.full(LINES, position), _TRAINING + position, seed)
            for n, slip in enumerate(SLIPS):
                there = wanted[:, _PADDING + slip :][:, : got.shape[1]]
                errors[position, :, n] = np.count_nonzero(got != there, axis=1)
        slips = np.array(SLIPS)[errors.argmin(axis=2)]
        good = errors.min(axis=2) == 0
        middles, eyes = np.zeros(LINES, np.int64), np.zeros(LINES)
        for line in range(LINES):
            middles[line], width = _eye(good[:, line], slips[:, line])
            eyes[line] = width * TAP_PS
        return Alignment(middles, slips[middles, np.arange(LINES)], eyes)

    def untrained(self) -> Alignment:
        """Settings before the training."""
        zero = np.zeros(LINES, np.int64)
        return Alignment(zero, zero, np.zeros(LINES))

    def receive(self, samples: Words, alignment: Alignment, frame: int, seed: int) -> Words:
        """(n,) samples as the FPGA has them after alignment."""
        words = np.pad(samples, _PADDING + max(SLIPS), mode="edge")
        got = self.registered(words, alignment.positions, frame, seed)
        value = np.zeros(samples.size, np.uint16)
        for line in range(LINES):
            start = max(SLIPS) - int(alignment.slips[line])
            value |= got[line, start:][: samples.size].astype(np.uint16) << np.uint16(line)
        return value

    def offsets(self, alignment: Alignment) -> Values:
        """(16,) ps from the middle of a bit to the sampling instant."""
        return self._sampled(alignment.positions)[1] - BIT_PS / 2

    def expected_errors(self, samples: Words, alignment: Alignment) -> float:
        """Mean number of wrong bits in these samples: the edges that they have, by the closed form
        for each side of a bit."""
        changed = samples[1:] ^ samples[:-1]
        total = 0.0
        for line, offset in enumerate(self.offsets(alignment).tolist()):
            edges = int(np.count_nonzero(changed >> np.uint16(line) & 1))
            total += edges * error_rate(offset, self.jitter, 1.0)
        return total


def _eye(good: npt.NDArray[np.bool_], slips: npt.NDArray[np.int64]) -> tuple[int, int]:
    """Middle and width, in positions, of the longest run of error-free positions of one word phase.

    The positions of a bit close to a ring: one bit later, the line is late by one bit more.
    """
    ring = np.concatenate([slips, slips + 1])
    fine = np.concatenate([good, good])
    begin = best = width = 0
    for n in range(ring.size):
        if not fine[n]:
            begin = n + 1
        elif n > begin and ring[n] != ring[n - 1]:
            begin = n
        if n + 1 - begin > width:
            best, width = begin, n + 1 - begin
    return (best + max(width - 1, 0) // 2) % good.size, width
