"""How long a spike waits for its packet and in the send buffer: chosen by what the link leaves.

A packet holds the cycles of its group, so a spike waits for its end, and then until its bits have
left. Short packets wait less and take more bits: a train of spikes is known worse at the ends of a
packet, and each packet has a head. So the shortest packets are taken with which the whole stream
fits, and the smallest buffer that they need. Both follow from the stream itself: parts of it are
coded before the run.

Where not even long packets fit, something gives way. `code.aim = "picture"` takes long packets,
whose layers are worth most a bit, and a buffer for groups of unequal worth; "delay" takes the
shortest ones and the smallest buffer, whatever fits into them (docs/glass-over-light.md has the
figures).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from cosim import Clock
from cosim.compute.table_cache import cached_value
from cosim.spikes.viform import Words
from sensor.codec.packets.catalogue import StreamCode
from sensor.codec.packets.coder import group_bits
from sensor.codec.packets.event import MOST_EVENT_CYCLES
from sensor.codec.packets.section import CYCLES, CodeSection

PHASES: Final = 8
"""Instants in the cycles of a packet at which packets end, each of an eighth of the tiles. They
wait for the bits of that eighth, not for those of all tiles."""
TRIED: Final = (32, 64, 96, 128, 192, 256)
"""Cycles of a packet that are tried."""
_SPANS: Final = 3
"""Parts of the stream that are coded."""
_FULL: Final = 0.98
"""Largest share of the link's bits that a stream may take: other parts of it may take more."""
_RESERVE: Final = 1.1
"""Factor on the buffer that the parts need, for the same reason."""
_HOPELESS: Final = 1.6
"""Share of the link's bits at the shortest packets from which longer ones are not tried: those of
128 cycles take .76 of the bits of those of 32 (docs/glass-over-light.md)."""
_LONG: Final = 3.0
"""The same share up to which the longest packets have the best picture; beyond it, those of CYCLES
cycles have: most of the bits are then sums, which a packet has once, whatever moves in it."""
_STEPS: Final = {"picture": 4, "delay": 2}
"""Buffer where not all fits, in steps from one end of packets to the next."""

Sample = Callable[[int, int], Words | None]
"""Words of the stream from a cycle on, as many cycles as given; None if they are not known."""


@dataclass(frozen=True)
class Need:
    """What the packets of a stream need of a link.

    Attributes:
        load: their bits, as a share of what the link carries.
        wait: longest time in the send buffer, cycles.
        excess: most that is left of it when the next packets come, cycles.
    """

    load: float
    wait: float
    excess: float

    @property
    def fits(self) -> bool:
        """Whether all are sent."""
        return self.load <= _FULL

    @property
    def buffer(self) -> int:
        """Buffer in which all are sent, cycles: the rate control sends a group whole as long as
        half of the buffer is free for the next one."""
        return math.ceil(_RESERVE * max(self.wait, 2 * self.excess)) + 1


def need_of(bits: npt.NDArray[np.float64], cycles: int, carried: float) -> Need:
    """Need of packets.

    Args:
        bits: bits of the packets of each phase, (phases,).
        cycles: cycles of a packet.
        carried: bits that the link carries in a cycle.
    """
    step = cycles / len(bits)
    left = wait = excess = 0.0
    for more in np.tile(bits / carried, 3):  # a queue whose load is below 1 repeats itself
        wait = max(wait, left + more)
        left = max(left + more - step, 0.0)
        excess = max(excess, left)
    return Need(float(bits.sum()) / carried / cycles, wait, excess)


@dataclass(frozen=True, eq=False)
class Stretch:
    """A stream before it is sent.

    Attributes:
        shape: (height, width).
        cycles, clock: its length and its clock.
        threshold, noise: threshold and noise of its pixels, electrons.
        sample: parts of it.
    """

    shape: tuple[int, int]
    cycles: int
    clock: Clock
    threshold: float
    noise: float
    sample: Sample

    def need(self, section: CodeSection, carried: float) -> Need | None:
        """Need of the packets of a section, the largest of some parts; None if none is known."""
        assert section.cycles is not None
        code, found = section.code(self.threshold, self.noise, PHASES), []
        length = min(2 * section.cycles, self.cycles)
        for n in range(_SPANS):
            first = (self.cycles - length) * (2 * n + 1) // (2 * _SPANS) // 32 * 32
            words = self.sample(first, length)
            if words is None:
                return None
            found.append(need_of(self._bits(code, words, length), section.cycles, carried))
        return Need(*(max(getattr(one, name) for one in found) for name in Need.__annotations__))

    def _bits(self, code: StreamCode, words: Words, cycles: int) -> npt.NDArray[np.float64]:
        def coded() -> list[float]:
            return group_bits(code, words, cycles).tolist()

        # A function of the spikes alone, which takes seconds: the next run has the same ones.
        kept = cached_value("packet_bits", (code, words, cycles), ("sensor",), list[float], coded)
        bits = np.array(kept)
        offsets = code.offsets(self.shape) * code.phases // code.cycles
        found = np.bincount(offsets, bits, code.phases).astype(np.float64)
        return found * max(code.cycles / cycles, 1.0)


def choose_hold(section: CodeSection, stream: Stretch, carried: float) -> tuple[CodeSection, str]:
    """A section whose cycles and buffer are numbers, and a note on how they were chosen; "" if the
    section gives both.

    Args:
        section: the section.
        stream: the stream.
        carried: bits that the link carries in a cycle.
    """
    hz = stream.clock.hz
    if section.cycles is not None and section.buffer is not None:
        return section, ""
    if section.rate is not None:
        carried = min(carried, section.rate / hz)
    most = MOST_EVENT_CYCLES if section.kind == "event" else TRIED[-1]
    tried = [n for n in TRIED if n <= most] if section.cycles is None else [section.cycles]
    aimed, why = section.aim == "delay", "the picture gives way as little as it must"
    cycles = CYCLES
    for n in tried[:1] if aimed else tried:
        need = stream.need(section.model_copy(update={"cycles": n}), carried)
        if need is None:
            cycles, why = CYCLES, "the stream is not known before the run"
            break
        if need.fits and (section.buffer is None or need.buffer <= section.buffer * hz):
            share = f"{100 * need.load:.0f} % of what the link carries"
            fits = "the shortest in which all fits" if section.cycles is None else "all fits"
            return _resolved(section, n, need.buffer / hz, f"{fits}, {share}")
        if n == tried[0]:
            cycles = tried[-1] if need.load <= _LONG else CYCLES
            if need.load > _HOPELESS:
                break
    if aimed:
        cycles, why = tried[0], "the delay is kept, and the picture gives way"
    cycles = section.cycles or cycles
    return _resolved(section, cycles, _STEPS[section.aim] * cycles // PHASES / hz, why)


def _resolved(
    section: CodeSection, cycles: int, buffer: float, why: str
) -> tuple[CodeSection, str]:
    """The section with cycles and buffer, unless it gives them, and the note."""
    buffer = buffer if section.buffer is None else section.buffer
    one = section.model_copy(update={"cycles": cycles, "buffer": buffer})
    given = "" if section.cycles is None else ", as given"
    return one, f"packets of {cycles} cycles{given}: {why}"
