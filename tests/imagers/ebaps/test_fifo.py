"""The FIFO between two clocks: Gray codes, and no word lost, doubled or moved at any two clocks."""

from __future__ import annotations

import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from imagers.ebaps.board.fifo import (
    AsyncFifo,
    Coin,
    Packer,
    Unpacker,
    edges_of,
    gray,
    ungray,
)

MHZ = 1_000_000


def cross(
    fifo: AsyncFifo, hertz: tuple[int, int], phases: tuple[int, int], count: int, seed: int,
    pauses: tuple[float, float] = (0.3, 0.3),
) -> list[int]:  # fmt: skip
    """Words 0, 1, ... through a FIFO whose both sides pause at random but heed their flags."""
    draw = random.Random(seed)
    clocks = {"write": hertz[0], "read": hertz[1]}
    given_, taken, idle = 0, [], 0
    for now, name in edges_of(clocks, {"write": phases[0], "read": phases[1]}):
        if name == "write":
            assert fifo.room_taken >= fifo.inside  # never less than there is
            wants = given_ < count and not fifo.full and draw.random() >= pauses[0]
            given_ += fifo.write_edge(now, given_ if wants else None)
        else:
            assert fifo.waiting <= fifo.inside
            word = fifo.read_edge(now, not fifo.empty and draw.random() >= pauses[1])
            idle = idle + 1 if word is None else 0
            if word is not None:
                taken.append(word)
        if len(taken) >= count or idle > 2000:
            return taken
    raise AssertionError


def test_gray_steps_change_one_bit_and_wrap() -> None:
    codes = [gray(n) for n in range(1024)]
    assert sorted(codes) == list(range(1024))
    assert all((a ^ b).bit_count() == 1 for a, b in zip(codes, codes[1:] + codes[:1], strict=True))
    assert [ungray(code) for code in codes] == list(range(1024))


@settings(max_examples=40, deadline=None)
@given(
    st.tuples(st.integers(10, 500), st.integers(10, 500)),
    st.tuples(st.integers(0, 50_000), st.integers(0, 50_000)),
    st.tuples(st.floats(0, 0.8), st.floats(0, 0.8)),
    st.sampled_from([4, 8, 64]),
    st.integers(0, 2**31 - 1),
)
def test_any_two_clocks(
    mhz: tuple[int, int], phases: tuple[int, int], pauses: tuple[float, float], depth: int,
    seed: int,
) -> None:  # fmt: skip
    fifo = AsyncFifo(depth, prog_empty=1, prog_full=depth, window=900, seed=seed)
    hertz = (mhz[0] * MHZ, mhz[1] * MHZ)
    assert cross(fifo, hertz, phases, 150, seed, pauses) == list(range(150))
    assert (fifo.overflows, fifo.underflows) == (0, 0)
    assert fifo.most <= depth


def test_binary_pointers_would_not_do() -> None:
    """The same proof finds the fault: clocks of nearly one rate slide through every window."""
    broken = 0
    for seed in range(8):
        for coded in (True, False):
            fifo = AsyncFifo(8, prog_empty=1, prog_full=8, window=2000, seed=seed, gray=coded)
            try:
                right = cross(fifo, (100 * MHZ, 101 * MHZ), (0, 700), 400, seed) == list(range(400))
            except AssertionError:  # a flag told of words that are not there
                right = False
            assert right or not coded
            broken += not right
    assert broken >= 4


def test_flags_come_two_edges_late_and_are_counted() -> None:
    fifo = AsyncFifo(8, prog_empty=2, prog_full=6, window=0)
    assert fifo.empty and fifo.prog_empty and not fifo.full
    fifo.write_edge(0, 7)
    seen = []
    for n in range(3):
        seen.append(fifo.empty)
        fifo.read_edge(100 + n)
    assert seen == [True, True, False]
    assert fifo.front == 7 and fifo.prog_empty
    for n in range(7):
        assert fifo.write_edge(200 + n, n)
        assert fifo.prog_full == (n >= 4)
    assert fifo.full and not fifo.write_edge(300, 9) and fifo.overflows == 1
    taken = [fifo.read_edge(400 + n, True) for n in range(11)]
    assert [word for word in taken if word is not None] == [7, 0, 1, 2, 3, 4, 5, 6]
    assert fifo.underflows == 3
    assert fifo.full  # its writer has had no edge since
    fifo.write_edge(500)
    fifo.write_edge(501)
    assert not fifo.full and fifo.room_taken == 0


def test_widths() -> None:
    packer, unpacker = Packer(), Unpacker()
    words = [packer.push(n, n == 18) for n in range(1, 19)]
    made = [word for word in words if word is not None]
    assert made[0] == sum(n + 1 << 16 * n for n in range(8))
    assert made[2] == 17 | 18 << 16 and len(made) == 3
    values = []
    for word in made:
        unpacker.load(word)
        while not unpacker.wants:
            values.append(unpacker.take())
    assert values == [*range(1, 19), *[0] * 6]
    with pytest.raises(ValueError, match="nothing is left"):
        unpacker.take()
    for bad in (0, 24):
        with pytest.raises(ValueError, match="multiple"):
            Packer(bad)
    for depth in (2, 12):
        with pytest.raises(ValueError, match="power of two"):
            AsyncFifo(depth)
    with pytest.raises(ValueError, match="1 to 8"):
        AsyncFifo(8, prog_empty=9)


def test_edges_and_coin() -> None:
    found = []
    for edge in edges_of({"a": 85 * MHZ, "b": 40 * MHZ}, {"b": 25_000}):
        found.append(edge)
        if len(found) == 1700 + 800:
            break
    assert found == sorted(found, key=lambda edge: edge[0])
    a = [ps for ps, name in found if name == "a"]
    assert a[85] == 10**6 and a[1] == 11_764  # no drift: 85 edges a microsecond
    coin = Coin(3, 2)
    share = sum(coin.below(0.25) for _ in range(20_000)) / 20_000
    assert abs(share - 0.25) < 5 * (0.25 * 0.75 / 20_000) ** 0.5
