"""Encoder and decoder in lockstep with the Python coder and, where asked, with their Verilog."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from rtl_model.events.encoder import OUTPUT, EventEncoder, EventSize, Output
from rtl_model.events.rates import steady_words, tiles_of
from sensor.codec.packets.event import Event, encode_events, packet_of_line
from sensor.codec.packets.packet import Packet
from tests.rtl_model.events.decoder import EventDecoder
from tests.rtl_model.events.verilated import VerilatedDecoder, VerilatedEncoder
from tests.sensor.codec.packets.told import gaps_of

_CHUNK = 1 << 23
"""Pixel-cycles of a chunk, about."""


def unequal(one, other):
    """Whether records differ in any field; their padding may."""
    return len(one) != len(other) or any(
        (one[name] != other[name]).any() for name in one.dtype.names
    )


def packets_in(words: Output) -> list[Packet]:
    """The packets of words that end with the last word of a packet. Raises Damaged for others."""
    data = words["data"].astype("<u2").tobytes()
    ends = 2 * (np.flatnonzero(words["last"]) + 1)
    return [packet_of_line(data[a:b]) for a, b in zip(np.append(0, ends)[:-1], ends, strict=True)]


def random_ready(clocks: int, share: float, seed: int) -> np.ndarray:
    """`m_tready` of a receiver that is ready in a share of the clocks, at random, and pauses now
    and then for up to 500 clocks; with share 1 it is always ready."""
    rng = np.random.default_rng(seed)
    if share >= 1:
        return np.ones(clocks, np.uint8)
    ready = (rng.integers(0, 256, clocks, np.uint8) < round(256 * share)).astype(np.uint8)
    for at in rng.integers(0, clocks, clocks // 20_000):
        ready[at : at + rng.integers(1, 500)] = 0
    return ready


class Light(NamedTuple):
    """What falls on the array, and how often the receiver is ready."""

    rate: float
    spread: float = 0.5
    jitter: float = 0.2
    ready: float = 0.6


@dataclass
class Result:
    """Of a run; `failure` is the first difference, "" for none."""

    failure: str = ""
    pixels: int = 0
    clocks: int = 0
    packets: int = 0
    gaps: int = 0
    spikes: int = 0
    lost_rows: int = 0
    lost_spikes: int = 0
    missing: int = 0
    """Groups that gave no packet."""


class _Run:
    def __init__(self, size: EventSize, verilog: bool, sources: Path | None) -> None:
        self.size, self.result = size, Result()
        self.encoder, self.decoder = EventEncoder(size), EventDecoder(size)
        self.their_encoder = VerilatedEncoder(size, sources) if verilog else None
        self.their_decoder = VerilatedDecoder(size, sources) if verilog else None
        self.groups: dict[int, np.ndarray] = {}  # words by first cycle, until their packet comes
        self.begun = np.empty(0, OUTPUT)
        self.lost = 0  # spikes in gaps and in groups without a packet

    def fail(self, what: str) -> None:
        self.result.failure = self.result.failure or what

    def encode(self, tiles, ready):
        """Runs both encoders; returns the words up to the end of the last packet."""
        words = self.encoder.run(tiles, ready)
        theirs = self.their_encoder
        if theirs is not None:
            other = theirs.run(tiles, ready)
            if unequal(other, words):
                both = min(len(other), len(words))
                same = [other[n][:both] == words[n][:both] for n in words.dtype.names]
                wrong = np.flatnonzero(~np.logical_and.reduce(same))
                at = int(np.append(wrong, both)[0])
                shown = [str(w[at]) if at < len(w) else "none" for w in (other, words)]
                self.fail(f"word {at} of the Verilog is {shown[0]}, of the model {shown[1]}")
            if (theirs.lost_rows, theirs.lost_spikes) != (
                self.encoder.lost_rows, self.encoder.lost_spikes,
            ):  # fmt: skip
                self.fail("counts of what was lost")
            if theirs.broken:
                self.fail("a word changed before it was taken")
        words = np.concatenate([self.begun, words])
        end = int(np.append(0, np.flatnonzero(words["last"]) + 1)[-1])
        self.begun = words[end:]
        return words[:end]

    def compare(self, packets):
        """Compares packets with those of the coder; returns the words that they hold."""
        size, held = self.size, []
        for packet in packets:
            head = (packet.code, packet.layer, packet.tile, packet.cycles)
            if head != (4, 0, size.tile, size.cycles) or packet.first not in self.groups:
                self.fail(f"head of the packet at {packet.first}: {head}")
                return held
            for first in [first for first in self.groups if first < packet.first]:
                self.result.missing += 1
                self.lost += int(np.bitwise_count(self.groups.pop(first)).sum())
            words = self.groups.pop(packet.first)
            gaps = gaps_of(packet.data, size.cycles)
            if encode_events(words, size.cycles, gaps) != packet.data:
                self.fail(f"data of the packet at {packet.first}")
            if gaps:
                shape = words.shape[1:]
                spikes = int(np.bitwise_count(words).sum())
                words = Event().decode([packet.data], shape, size.cycles)
                self.lost += spikes - int(np.bitwise_count(words).sum())
            held.append((packet, words, gaps))
            self.result.packets += 1
            self.result.gaps += len(gaps)
        return held

    def decode(self, words, held, offered, ready):
        """Feeds packets to both decoders and compares what comes out with what they hold."""
        size = self.size
        clocks = 40 * len(words) + len(held) * (800 * size.pixels + 1000)
        idle = 60 * size.pixels + 600
        got = self.decoder.run(words, offered, ready, clocks, idle)
        if self.their_decoder is not None:
            other = self.their_decoder.run(words, offered, ready, clocks, idle)
            if unequal(other.words, got.words) or unequal(other.gaps, got.gaps):
                self.fail("words of the decoder's Verilog")
            if self.their_decoder.clock != self.decoder.clock or self.their_decoder.broken:
                self.fail("stream of the decoder's Verilog")
            if self.their_decoder.packets != self.decoder.packets or self.their_decoder.damaged:
                self.fail("counters of the decoder's Verilog")
        out, each = got.words, size.cycles // 32 * size.pixels
        if len(out) != each * len(held) or got.taken != len(words) or self.decoder.damaged:
            self.fail(f"{len(out)} words of {each * len(held)} were decoded")
            return
        if not held:
            return
        out = out.reshape(len(held), each)
        wanted = np.stack([w.reshape(-1) for _, w, _ in held])
        places = [128 * c + r for _, _, gaps in held for g in gaps
                  for c, r in (g[:2], g[2:]) if c < size.cycles]  # fmt: skip
        if not (
            np.array_equal(out["data"], wanted)
            and (out["first"] == np.array([[p.first // 32] for p, _, _ in held])).all()
            and (out["tile"] == size.tile).all()
            and (out["gaps"] == np.array([[bool(gaps)] for _, _, gaps in held])).all()
            and (out["last"][:, -1] == 1).all()
            and not out["last"][:, :-1].any()
            and got.gaps["place"].tolist() == places
        ):
            self.fail("spikes that were decoded")


def run(
    size: EventSize,
    light: Light,
    pixels: float,
    *,
    slack: int = 0,
    seed: int = 1,
    verilog: bool = False,
    sources: Path | None = None,
) -> Result:
    """Compares until `pixels` pixel-cycles or the first difference.

    slack: clocks of a frame beyond the fewest. verilog: also runs the Verilog, of the folder
    `sources` if given.
    """
    one = _Run(size, verilog, sources)
    result = one.result
    tick, first, clock = size.tick_minimum + slack, 0, 0
    groups = max(1, min(_CHUNK, int(pixels)) // (size.pixels * size.cycles))
    while result.pixels < pixels and not result.failure:
        seed += 1
        cycles = groups * size.cycles
        words = steady_words(size, cycles, *light[:3], seed)
        for n in range(groups):
            part = words[n * size.cycles // 32 : (n + 1) * size.cycles // 32]
            one.groups[first + n * size.cycles] = part
        tiles = tiles_of(words, size, tick, first, clock)
        ready = random_ready(cycles * tick, light.ready, seed)
        out = one.encode(tiles, ready)
        one.decode(
            out, one.compare(packets_in(out)), random_ready(len(ready), 0.9, -seed % 2**31), ready
        )
        result.pixels += size.pixels * cycles
        result.spikes += int(np.bitwise_count(words).sum())
        first, clock = first + cycles, clock + cycles * tick
    # A row of the next group ends the last packet, once the queue is empty.
    pause = 8 * size.depth * (size.lanes + 2) + 40 * size.pixels + 4000
    last = tiles_of(np.zeros((1, size.rows, size.columns), np.uint32), size, tick, first,
                    clock + pause)[: size.tiles]  # fmt: skip
    out = one.encode(last, random_ready(2 * pause, light.ready, seed))
    if not result.failure:
        one.decode(out, one.compare(packets_in(out)), np.ones(1, np.uint8), np.ones(1, np.uint8))
    result.clocks = one.encoder.clock
    result.lost_rows, result.lost_spikes = one.encoder.lost_rows, one.encoder.lost_spikes
    if not result.failure and one.groups:
        result.failure = f"no packet of {sorted(one.groups)}"
    if not result.failure and one.lost != result.lost_spikes:
        result.failure = f"{result.lost_spikes} spikes counted as lost, {one.lost} missing"
    return result
