"""Patches behind a code whose layers were not all sent: the bits of the whole stream's decoder."""

from __future__ import annotations

import numpy as np
import pytest

from cosim import Clock, Viform
from cosim.plan.tiles import PatchPlane, TileGrid
from scenarios.assemble.behind.link.coding import CutCode
from sensor.codec.packets.catalogue import KINDS
from sensor.codec.packets.coder import StreamEncoder
from sensor.codec.packets.decoder import StreamDecoder
from sensor.codec.packets.section import CodeSection

SHAPE = (72, 56)


def stream(cycles: int) -> Viform:
    """Trains of every rate, with some jitter."""
    rng = np.random.default_rng(5)
    rate = rng.uniform(0, 1.0, SHAPE) ** 2
    phase = np.cumsum(rate * rng.uniform(0.7, 1.3, (cycles, *SHAPE)), axis=0) + rng.random(SHAPE)
    return Viform.from_planes(np.diff(np.floor(phase), axis=0, prepend=0) > 0, Clock(40_000))


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("tile", [8, 24, 64])
@pytest.mark.parametrize("phases", [1, 8])
def test_patches_decode_as_the_whole_stream_does(kind: str, tile: int, phases: int) -> None:
    given, rng = stream(230), np.random.default_rng(tile)
    code = CodeSection(kind=kind, cycles=64, tile=tile).code(1000.0, 5.0, phases)
    encoder, decoder = StreamEncoder(code, SHAPE), StreamDecoder(code, SHAPE, length=230)
    cut: dict[tuple[int, int], int] = {}
    for packet in [*encoder.encode(given.words, 0, 230), *encoder.flush()]:
        place = packet.first, packet.tile
        if packet.layer == 0 and rng.random() < 0.7:
            cut[place] = int(rng.integers(0, 5))
        if packet.layer < cut.get(place, 99):
            decoder.take(packet.to_bytes())
    whole = decoder.read(230).words
    plane = PatchPlane(TileGrid(*SHAPE), [0, 2, 5, 9])
    numbers = plane.numbers.astype(int)
    words = given.words.reshape(len(given.words), -1)[:, numbers]
    seen = CutCode(code, SHAPE, cut, plane).through(words, 230)
    assert np.array_equal(seen, whole.reshape(len(whole), -1)[:, numbers])
    assert not np.array_equal(seen, words)
