"""Faults: their notation, their effect on bytes, and the number of bits that noise inverts."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosim import InputError
from rtl_model.geometry import Geometry
from rtl_model.virtual.faults import ByteFault, Faults, parse
from rtl_model.virtual.line import BITS, CUT_S, POWER_UP_S, Bytes, FaultyLine, Interruption, noise

WORDS = ("drop", "flip", "extra", "cut", "power-cycle", "silent", "slow", "baud", "noise", "stuck")
PIECES = (*WORDS, "foreign", ":", "@", "%", "=", ",", "rx", "tx", "0", "7", "-", ".", "nan", "1e9")


def test_every_form_is_read() -> None:
    texts = ("drop:rx@100", "flip:tx%5000", "extra:rx@3", "cut@20", "cut:tx@6", "power-cycle@50")
    texts += ("silent", "slow=20", "baud=-6", "noise=0.001", "stuck=3,7", "stuck=0,31,0", "foreign")
    assert parse(texts) == Faults(
        line=(
            ByteFault("drop", "rx", 100),
            ByteFault("flip", "tx", 5000, every=True),
            ByteFault("extra", "rx", 3),
            ByteFault("cut", "rx", 20),
            ByteFault("cut", "tx", 6),
            ByteFault("power-cycle", "rx", 50),
        ),
        silent=True,
        delay_s=0.02,
        baud_error=-0.06,
        noise=0.001,
        stuck=((3, 7, 1), (0, 31, 0)),
        foreign=True,
    )


@given(st.one_of(st.text(max_size=40), st.lists(st.sampled_from(PIECES)).map("".join)))
def test_any_text_is_a_fault_or_one_line(text: str) -> None:
    try:
        faults = parse([text])
    except InputError as exc:
        assert "\n" not in str(exc)
    else:
        assert faults != Faults() or text.partition("=")[0] in ("slow", "baud", "noise")


@pytest.mark.parametrize("text", ["stuck=4,0", "stuck=0,40", "stuck=0,0,2", "drop@3", "drop:rx@0"])
def test_what_lies_outside_is_refused(text: str) -> None:
    with pytest.raises(InputError, match="a fault of the board must be"):
        parse([text], Geometry(rows=4, columns=40))


def carried(data: bytes, *texts: str, blocks: int = 1000) -> list[Bytes | Interruption]:
    line = FaultyLine(parse(texts))
    pieces = [data[at : at + blocks] for at in range(0, len(data), blocks)]
    return [made for piece in pieces for made in line.carry("rx", piece)]


def test_bytes_are_dropped_doubled_and_flipped() -> None:
    data = bytes(range(10))
    assert carried(data, "drop:rx@3", "extra:rx%4") == [
        Bytes(bytes([0, 1, 3, 3, 4, 5, 6, 7, 7, 8, 9]))
    ]
    (piece,) = carried(data, "flip:rx%2")
    assert isinstance(piece, Bytes)
    changed = [(a ^ b).bit_count() for a, b in zip(data, piece.data, strict=True)]
    assert changed == [0, 1] * 5
    assert carried(data, "drop:tx@3") == [Bytes(data)]


def test_every_bit_is_flipped_as_often() -> None:
    (piece,) = carried(bytes(800), "flip:rx%1", blocks=800)
    assert isinstance(piece, Bytes)
    counts = np.bincount(np.frombuffer(piece.data, np.uint8), minlength=129)[2 ** np.arange(8)]
    assert counts.sum() == 800
    assert np.all(np.abs(counts - 100) <= 2)  # a low-discrepancy sequence, not a random one


@pytest.mark.parametrize("blocks", [1, 3, 100])
def test_a_cut_stands_between_its_bytes(blocks: int) -> None:
    made = carried(bytes(range(10)), "cut@4", "power-cycle@8", blocks=blocks)
    dead = [(n, piece) for n, piece in enumerate(made) if isinstance(piece, Interruption)]
    before = [b"".join(p.data for p in made[:n] if isinstance(p, Bytes)) for n, _ in dead]
    cut, cycled = Interruption(CUT_S, False), Interruption(POWER_UP_S, True)
    assert [piece for _, piece in dead] == [cut, cycled]
    assert before == [bytes(range(3)), bytes(range(7))]


def test_noise_inverts_its_share_of_bits() -> None:
    count, share = 20_000, 0.02
    masks = noise(share, 1, "rx", 5, count)
    assert np.array_equal(masks[700:], noise(share, 1, "rx", 705, count - 700))
    assert not np.array_equal(masks, noise(share, 1, "tx", 5, count))
    # 5.33 sigma of each of ten binomials of mean 400: alpha 1e-6 with Bonferroni.
    for bit in range(BITS):
        hits = int(np.count_nonzero(masks >> bit & 1))
        assert abs(hits - count * share) < 5.33 * np.sqrt(count * share * (1 - share))
    assert not np.any(masks >> BITS)
