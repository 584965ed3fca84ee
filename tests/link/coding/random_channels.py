"""Random channels between the cells of a sender and the soft values of a receiver.

A channel is white noise on signs, from none to as much that no word can be read, with what else
goes wrong: erasures, bursts, values that are too large or too small, a slip of the symbols, groups
that are lost, a panel that is dark or hidden. What the receiver takes for right is compared with
what was sent.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from scipy.stats import norm

from link.coding import Inbox, Outbox, blocks_of
from link.coding.boxes import Frame
from link.layout import Layout
from tests.link.coding.ldpc_channel import capacity
from tests.link.coding.soft import soft_of

_SIGMAS = np.geomspace(0.15, 5, 300)
_CARRIED = np.array([capacity(sigma) for sigma in _SIGMAS])


class CheckedInbox(Inbox):
    """An inbox that compares each frame it takes for right with what was sent.

    Attributes:
        wrong: frames taken for right that were never sent.
    """

    def __init__(self, layout: Layout, interleave: bool, outbox: Outbox) -> None:
        super().__init__(layout, interleave=interleave)
        self._sent = {packet[:4]: packet for packet in outbox._packets}
        self._named = outbox._session, outbox._length
        self.wrong = 0

    def _gather(self, frame: Frame) -> None:
        named = (frame.session, frame.length) == self._named
        self.wrong += not named or self._sent.get(frame.packet[:4]) != frame.packet
        super()._gather(frame)


@dataclass
class Totals:
    """What went through the channels.

    Attributes:
        bits: file bits in the frames that the receiver read.
        right, lost, wrong: those frames: right and reported so, reported lost, and neither.
        errors: wrong decisions on cells, before any code.
        files, delivered, false: files sent, received right, and received wrong.
    """

    bits: int = 0
    right: int = 0
    lost: int = 0
    wrong: int = 0
    errors: int = 0
    files: int = 0
    delivered: int = 0
    false: int = 0
    kinds: dict[str, int] = field(default_factory=dict)

    def count(self, kind: str) -> None:
        self.kinds[kind] = self.kinds.get(kind, 0) + 1


def noise_for(layout: Layout, rng: np.random.Generator) -> float:
    """Standard deviation of the noise on signs: easy, near what the code bears, or hopeless."""
    mode, u = layout.mode, rng.random()
    if mode.rate is not None:
        low, high = ((mode.rate + 0.01, 1), (mode.rate - 0.01, mode.rate + 0.02),
                     (0.05, mode.rate - 0.01))[0 if u < 0.65 else 1 if u < 0.85 else 2]  # fmt: skip
        return float(np.interp(-rng.uniform(low, high), -_CARRIED, _SIGMAS))
    assert mode.parity is not None
    most = mode.parity / 2
    few = rng.uniform(*((0.01, 0.5), (0.5, 1.5), (1.5, 20))[0 if u < 0.65 else 1 if u < 0.9 else 2])
    symbol_errors = min(few * most / 255, 0.99)
    return float(1 / norm.isf(min(-np.expm1(np.log1p(-symbol_errors) / 8), 0.49)))


def spoil(soft: np.ndarray, rng: np.random.Generator, totals: Totals) -> np.ndarray:
    """Adds what else goes wrong to the soft values of a group, (symbols, cells), in place."""
    symbols, cells = soft.shape
    if rng.random() < 0.2:
        totals.count("erasures")
        gone = rng.random(cells, np.float32) < rng.uniform(0, 0.12)
        soft[:, gone] = rng.choice([0.0, np.nan])
    if rng.random() < 0.2:
        totals.count("burst")
        long = int(rng.uniform(0, 0.05 if rng.random() < 0.8 else 1) * cells)
        begin = rng.integers(0, cells - long + 1)
        some = soft[:, begin : begin + long]
        some[:] = rng.normal(0, rng.choice([0.5, 5, 50]), some.shape)
    if rng.random() < 0.2:
        totals.count("scale")
        soft *= np.float32(rng.choice([0.1, 0.5, 3, 100]))
    if rng.random() < 0.03:
        totals.count("slip")
        soft[:] = np.roll(soft, rng.integers(1, symbols), axis=0)
    if rng.random() < 0.03:
        totals.count("slip across cells")
        soft[:] = np.roll(soft, rng.integers(1, cells), axis=1)
    if rng.random() < 0.02:
        totals.count("dark")
        soft[:] = -9
    return soft


def send_file(
    layout: Layout, size: int, rng: np.random.Generator, totals: Totals, interleave: bool = True
) -> CheckedInbox:
    """Sends a file of `size` random bytes through a random channel, anew for each group."""
    data = rng.bytes(size)
    outbox = Outbox(data, "x", layout, interleave=interleave, overhead=rng.choice([0, 0.05, 0.5]))
    inbox, form = CheckedInbox(layout, interleave, outbox), blocks_of(layout, interleave)
    for group in range(outbox.groups):
        if rng.random() < 0.02:
            totals.count("lost group")
            continue
        soft = soft_of(layout, outbox.values(group), 1.0)
        sent = soft > 0
        if rng.random() < 0.9:
            sigma = np.float32(noise_for(layout, rng))
            soft += sigma * rng.standard_normal(soft.shape, np.float32)
            soft *= 2 / sigma**2
        soft = spoil(soft, rng, totals)
        totals.errors += int(np.count_nonzero((soft > 0) != sent))
        late = rng.random() < 0.01
        totals.kinds["wrong number"] = totals.kinds.get("wrong number", 0) + late
        inbox.put(group + late, soft)
    inbox.flush()
    totals.files += 1
    totals.bits += 8 * inbox.frames_read * form.symbol_bytes
    totals.wrong += inbox.wrong
    totals.right += inbox.frames_right - inbox.wrong
    totals.lost += inbox.frames_read - inbox.frames_right
    if inbox.file is not None:
        same = (inbox.file.data, inbox.file.name) == (data, "x")
        totals.delivered += same
        totals.false += not same
    return inbox
