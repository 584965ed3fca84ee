"""Cases 11 and 18: spikes on a latch edge, and counters beyond 2^31 and 2^32."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from typing import Final, NamedTuple

import numpy as np
import numpy.typing as npt

from cosim import PS, Block, Clock, Light, Piece
from cosim.compute.opencl import Device
from cosim.compute.streams import Stream
from cosim.run.case import Case
from cosim.spikes.viform import unpack_planes
from sensor import EFFECTS, SpikeCamera, make_pixels
from sensor.asynchronous import latched
from sensor.latched.effects import RESIDUAL
from sensor.latched.exposure import Exposure
from sensor.latched.pixel.charge import ONE, Charge, Span
from sensor.latched.pixel.interval import threshold as quantile
from sensor.latched.pixel.model import ExactModel, PixelState
from sensor.stability.cutting import SMALL
from sensor.stability.gathering import CLOCK

Bits = npt.NDArray[np.uint8]

# 11 ------------------------------------------------------------------------------------------


class Edges(NamedTuple):
    """The functions that the cases of cycle edges call.

    Attributes:
        pixel: (charge a cycle and threshold in Q24.40, cycles) -> bits of each cycle, (cycles, n).
        latch: (instants in ps, first cycle, cycles) -> bits set in each cycle, of the 40 kHz clock.
    """

    pixel: Callable[[Charge, int, int], Bits]
    latch: Callable[[npt.NDArray[np.int64], int, int], npt.NDArray[np.int64]]


def _edges(device: Device | None) -> Edges:
    def pixel(charge: Charge, q: int, cycles: int) -> Bits:
        model = ExactModel(q / ONE, 1, (RESIDUAL,))
        pixels = make_pixels(model, np.arange(charge.size, dtype=np.uint32), device)
        words = pixels.expose([Span(0, cycles, charge)], cycles)
        return unpack_planes(words[:, None, :], 0, cycles)[:, 0]

    def latch(instants: npt.NDArray[np.int64], first: int, cycles: int) -> npt.NDArray[np.int64]:
        period = PS * CLOCK.den // CLOCK.num
        return np.bincount(latched(instants, period) - first, minlength=cycles)

    return Edges(pixel, latch)


def edges(method: Edges, cycles: int = 3000) -> float:
    """Wrong bits. Charge that equals the threshold at an edge fires in the cycle that ends there,
    one unit less in the next; an instant on an edge belongs to the cycle that ends there."""
    wrong = 0
    for n in (3, 7, 10, 641):
        share = round(0.1 * ONE) | 1
        q = n * share
        charge = np.array([share - 1, share, share + 1], np.int64)
        bits = method.pixel(charge, q, cycles)
        for c, given in zip(charge.tolist(), bits.T, strict=True):
            due = [c * (j + 1) // q - c * j // q for j in range(cycles)]
            wrong += int((given != np.array(due)).sum())
    for first in (0, 2**31 - 4, 2**32 - 4):
        for offset in (-1, 0, 1):
            for k in range(1, 7):
                instant = CLOCK.edge(first + k) + offset
                counts = method.latch(np.array([instant]), first, 8)
                place = -(-Fraction(instant, PS) // CLOCK.period) - 1 - first
                wrong += int(np.abs(counts - (np.arange(8) == place)).sum())
    return float(wrong)


# 18 ------------------------------------------------------------------------------------------


class Counters(NamedTuple):
    """The functions that the cases of long runs call.

    Attributes:
        edge: (clock, k) -> ps.
        charge: (light, first cycle, cycles) -> charge of each cycle in Q24.40.
        film: (first cycle) -> bits of 128 cycles of light that begins with them.
        draw: (pixels, index) -> threshold of that interval, Q24.40.
    """

    edge: Callable[[Clock, int], int]
    charge: Callable[[Light, int, int], list[int]]
    film: Callable[[int], Bits]
    draw: Callable[[npt.NDArray[np.uint32], int], Charge]


Q: Final = 1000.0


def _counters(device: Device | None) -> Counters:
    def charge(light: Light, start: int, cycles: int) -> list[int]:
        spans = Exposure(CLOCK, 1.0).spans(light, start, cycles)
        made = []
        for span in spans:
            slope = 0 if span.slope is None else int(span.slope[0])
            made += [int(span.charge[0]) + slope * (span.elapsed + i) for i in range(span.cycles)]
        return made

    def film(start: int) -> Bits:
        shape = SMALL.chip.height, SMALL.chip.width
        one, two = (np.random.default_rng(n).random(shape, np.float32) * 40 for n in (3, 4))
        begin, end = CLOCK.edge(start), CLOCK.edge(start + 200)
        light = Light((Piece(begin, begin + 333_333_333, one, one),
                       Piece(begin + 333_333_333, end, one, two)))  # fmt: skip
        camera = SpikeCamera(SMALL, device)
        return unpack_planes(camera.step(light, Block(start, 128)).words, 0, 128)

    def draw(pixels: npt.NDArray[np.uint32], index: int) -> Charge:
        made = make_pixels(ExactModel(Q, 7, tuple(EFFECTS.values())), pixels, device)
        # A full pixel ends interval index - 1 with one unit of charge: what it lacks then is the
        # next threshold.
        spikes = np.full(pixels.size, index - 1, np.uint64)
        made.restore(PixelState(np.zeros(pixels.size, np.int64), spikes))
        made.expose([Span(0, 1, np.ones(pixels.size, np.int64))], 1)
        return made.state().deficit + 1

    return Counters(Clock.edge, charge, film, draw)


def _philox(counter: Sequence[int], key: Sequence[int]) -> list[int]:
    """Philox4x32-10 in Python's integers, after Salmon et al., SC11, section 3.3."""
    (a, b, c, d), (k, m) = counter, key
    for _ in range(10):
        x, y = 0xD2511F53 * a, 0xCD9E8D57 * c
        a, b, c, d = (y >> 32) ^ b ^ k, y % 2**32, (x >> 32) ^ d ^ m, x % 2**32
        k, m = (k + 0x9E3779B9) % 2**32, (m + 0xBB67AE85) % 2**32
    return [a, b, c, d]


def _around(*middles: int) -> list[int]:
    return [m + i for m in middles for i in range(-4, 5)]


def _jumps(method: Counters) -> int:
    """Wrong edges, charges and bits around cycles 2^31 and 2^32."""
    wrong = 0
    for clock in (CLOCK, Clock(60), Clock(85_000_000), Clock(2997, 100)):
        for k in _around(2**31, 2**32):
            wrong += method.edge(clock, k) != PS * k * clock.den // clock.num
    for turn in (2**31, 2**32):
        # A ramp of a cycle's charge from 0 to 32 e over the 64 cycles around the turn.
        start, stop = CLOCK.edge(turn - 32), CLOCK.edge(turn + 32)
        zero = np.zeros((1, 1), np.float32)
        top = np.full((1, 1), 32 * CLOCK.num, np.float32)
        light = Light((Piece(0, start, zero, zero), Piece(start, stop, zero, top)))
        due = [0] * 8 + [ONE * (2 * j + 1) // 4 for j in range(64)]
        given = method.charge(light, turn - 40, 72)
        # The slope is cut to a whole unit a cycle.
        wrong += sum(abs(a - b) > 64 for a, b in zip(given, due, strict=True))
        wrong += int((method.film(turn - 64) != method.film(0)).sum())
    return wrong


def _repeats(method: Counters) -> int:
    """Thresholds that are not those of their counter, or that came before, around the indices where
    a 32-bit index, a 32-bit block and the low counter word wrap."""
    wrong, pixels = 0, np.array([0, 1, 77, 2**32 - 1], np.uint32)
    table = ExactModel(Q, 7, tuple(EFFECTS.values())).table()
    seen: dict[int, set[int]] = {int(p): set() for p in pixels}
    indices = [*range(1, 9), *_around(2**31, 2**32, 2**33, 2**34)]
    for k in indices:
        given = method.draw(pixels, k)
        for p, value in zip(pixels.tolist(), given.tolist(), strict=True):
            word = _philox((p, k >> 34, k >> 2 & 0xFFFFFFFF, 0), (7, Stream.SHOT_NOISE))[k & 3]
            wrong += value != int(quantile(table, np.array([word], np.uint32))[0])
            wrong += value in seen[p]
            seen[p].add(value)
    return wrong


def late(method: Counters) -> float:
    """Edges, charges, bits and draws that are not what they must be."""
    return float(_jumps(method) + _repeats(method))


TICKS: Final = (
    Case(
        11,
        "spike on a latch edge",
        "a tie fires in the cycle that ends; one unit either way moves it; never 0 or 2 bits",
        "Python integers",
        "both edges counted, or neither",
        "bits",
        0.0,
        edges,
        _edges,
    ),
    Case(
        18,
        "counters beyond 2^31 and 2^32",
        "no jump of clock, charge or bits; no repeated random numbers (29.8 h at 40 kHz)",
        "Python integers, Philox in them",
        "32-bit tick and spike counters",
        "values",
        0.0,
        late,
        _counters,
    ),
)
