"""Reed-Solomon against a known word, its definition, its bound, and (slow) another library."""

import numpy as np
import pytest

from link.coding.reed_solomon import ReedSolomon
from link.mode import PARITIES

PARITY_OF_COUNT = "2fbd4fb4748494b9acd554627212eeb3ebed41191de1d36320ea49290b25abcf"
"""Of data 0 to 222, as reedsolo 1.7.0 and galois 0.4.11 have it with CCSDS's parameters."""


def times(a: int, b: int) -> int:
    """A product in the field, shift by shift."""
    out = 0
    while b:
        out ^= a if b & 1 else 0
        a = (a << 1) ^ (0x187 if a & 0x80 else 0)
        b >>= 1
    return out


def power(a: int, n: int) -> int:
    out = 1
    for _ in range(n):
        out = times(out, a)
    return out


def damaged(rng, words, errors, erasures):
    """Words with exactly so many wrong bytes each, and so many erased ones of any value."""
    out, erased = words.copy(), np.zeros(words.shape, bool)
    for w in range(len(words)):
        places = rng.permutation(255)
        out[w, places[:errors]] ^= rng.integers(1, 256, errors, dtype=np.uint8)
        gone = places[errors : errors + erasures]
        out[w, gone] = rng.integers(0, 256, erasures)
        erased[w, gone] = True
    return out, erased


def test_the_known_word():
    words = ReedSolomon(32).encode(np.arange(223)[None])
    assert words[0, :223].tolist() == list(range(223))
    assert words[0, 223:].tobytes().hex() == PARITY_OF_COUNT


@pytest.mark.parametrize("parity", PARITIES)
def test_codewords_vanish_at_the_roots(parity):
    code = ReedSolomon(parity)
    rng = np.random.default_rng(parity)
    word = code.encode(rng.integers(0, 256, (1, code.data_bytes)))[0].tolist()
    step = power(2, 11)
    for j in (0, 1, parity // 2, parity - 1):
        root, value = power(step, 128 - parity // 2 + j), 0
        for byte in word:
            value = times(value, root) ^ byte
        assert value == 0


@pytest.mark.parametrize("parity", PARITIES)
def test_all_is_mended_up_to_the_bound(parity):
    code = ReedSolomon(parity)
    rng = np.random.default_rng(parity + 1)
    data = rng.integers(0, 256, (12, code.data_bytes), dtype=np.uint8)
    words = code.encode(data)
    for errors in (0, 1, parity // 4, parity // 2 - 1, parity // 2):
        for erasures in {0, 1, (parity - 2 * errors) // 2, parity - 2 * errors}:
            if 2 * errors + erasures > parity:
                continue
            given, erased = damaged(rng, words, errors, erasures)
            read, ok, corrected = code.decode(given, erased)
            assert ok.all() and (read == data).all()
            assert (corrected == (given != words).sum(axis=1)).all()


@pytest.mark.parametrize("parity", PARITIES)
def test_beyond_the_bound_it_says_so(parity):
    """Or finds another codeword; never does it call a word mended that is none."""
    code = ReedSolomon(parity)
    rng = np.random.default_rng(parity + 2)
    words = code.encode(rng.integers(0, 256, (60, code.data_bytes), dtype=np.uint8))
    for errors, erasures in ((parity // 2 + 1, 0), (parity // 4 + 1, parity // 2), (1, parity)):
        given, erased = damaged(rng, words, errors, erasures)
        mended, ok, corrected = code.repair(given, erased)
        assert not (mended[ok] == words[ok]).all(axis=1).any()
        assert (code.encode(mended[ok, : code.data_bytes]) == mended[ok]).all()
        assert (mended[~ok] == given[~ok]).all() and (corrected[~ok] == 0).all()
        assert ((mended != given).sum(axis=1) == corrected).all()
        if erasures == 0 and parity > 16:
            assert not ok.any()  # one of t! words of chance
    given, erased = damaged(rng, words, 1, parity + 1)
    assert not code.decode(given, erased)[1].any()


def test_words_of_chance_are_taken_for_codewords_as_often_as_spheres_fill_space():
    """With parity 4 a share sum_j C(255, j) 255^j / 256^4, j <= 2, of all words."""
    code = ReedSolomon(4)
    words = np.random.default_rng(5).integers(0, 256, (4000, 255), dtype=np.uint8)
    share = sum(n * 255.0**j for j, n in enumerate((1, 255, 255 * 254 / 2))) / 256.0**4
    taken = code.decode(words)[1].sum()
    assert abs(taken - 4000 * share) < 5 * np.sqrt(4000 * share * (1 - share))  # 1e-6


def test_what_cannot_be():
    for parity in (0, 3, 256):
        with pytest.raises(ValueError, match="parity must be even, 2 to 254"):
            ReedSolomon(parity)
    code = ReedSolomon(32)
    with pytest.raises(ValueError, match=r"data must be \(words, 223\)"):
        code.encode(np.zeros((1, 224)))
    with pytest.raises(ValueError, match=r"words must be \(words, 255\)"):
        code.decode(np.zeros((1, 223)))
    with pytest.raises(ValueError, match=r"erasures must be \(1, 255\)"):
        code.decode(np.zeros((1, 255)), np.zeros((2, 255), bool))


@pytest.mark.slow
@pytest.mark.parametrize("parity", [16, 32])
def test_galois_says_the_same(parity):
    galois = pytest.importorskip("galois")
    field = galois.GF(2**8, irreducible_poly=0x187, primitive_element=2)
    theirs = galois.ReedSolomon(
        255, 255 - parity, field=field, alpha=field(2) ** 11, c=128 - parity // 2
    )
    ours = ReedSolomon(parity)
    rng = np.random.default_rng(6)
    data = rng.integers(0, 256, (40, ours.data_bytes), dtype=np.uint8)
    words = ours.encode(data)
    assert (np.asarray(theirs.encode(field(data))) == words).all()
    seen = set()
    for erasures in (0, 1, parity // 2, parity - 1, parity):
        for beyond in (-1, 0, 1, 2):
            errors = (parity - erasures) // 2 + beyond
            if errors < 0:
                continue
            given, erased = damaged(rng, words, errors, erasures)
            read, count = theirs.decode(field(given), erasures=erased, errors=True)
            mended, ok, _ = ours.decode(given, erased)
            # With parity - 1 erasures and an error galois 0.4.11 calls words right that are none:
            # told by how far the codeword of what it read is from what it was given.
            read = np.asarray(read)
            far = ((ours.encode(read) != given) & ~erased).sum(axis=1)
            right = (np.asarray(count) >= 0) & (2 * far + erasures <= parity)
            assert (ok == right).all()
            assert (mended[ok] == read[ok]).all()
            seen |= set(ok.tolist())
    assert seen == {True, False}
