"""Line codes: their tables, their promises of balance and runs, and reading them."""

import itertools

import numpy as np
import pytest

from link.line_codes import CATALOGUE, decode_line, encode_line
from link.mode import LINE_CODES

CODES_4B6B = CATALOGUE["4b6b"].codewords[0]
CODES_8B10B, FLIPS_8B10B = CATALOGUE["8b10b"].codewords, CATALOGUE["8b10b"].toggles
BALANCED = [line for line in LINE_CODES if CATALOGUE[line].run_limit]


def text(code: int, bits: int) -> str:
    return "".join(str(code >> k & 1) for k in range(bits))


def longest(shown: str) -> int:
    return max(len(list(same)) for _, same in itertools.groupby(shown))


def soft_of(bits: np.ndarray, sure: float = 4.0) -> np.ndarray:
    return np.where(bits, sure, -sure).astype(np.float32)


# D.x.y at negative and positive running disparity, out of the standards that use the code.
@pytest.mark.parametrize(
    ("x", "y", "negative", "positive"),
    [
        (0, 0, "1001110100", "0110001011"),
        (21, 5, "1010101010", "1010101010"),
        (10, 2, "0101010101", "0101010101"),
        (7, 0, "1110001011", "0001110100"),
        (3, 3, "1100011100", "1100010011"),
        (17, 7, "1000110111", "1000110001"),
        (11, 7, "1101001110", "1101001000"),
        (31, 7, "1010110001", "0101001110"),
        (16, 2, "0110110101", "1001000101"),
    ],
)
def test_8b10b_has_the_published_codes(x, y, negative, positive):
    assert text(CODES_8B10B[0, x | y << 5], 10) == negative
    assert text(CODES_8B10B[1, x | y << 5], 10) == positive


def test_8b10b_keeps_its_disparity_and_its_runs():
    ones = np.bitwise_count(CODES_8B10B).astype(int)
    assert (ones[0] - 5 == FLIPS_8B10B).all() and (5 - ones[1] == FLIPS_8B10B).all()
    meanings = {}
    for disparity, value in itertools.product((0, 1), range(256)):
        assert meanings.setdefault(int(CODES_8B10B[disparity, value]), value) == value
    after = np.array([[0], [1]]) ^ FLIPS_8B10B
    pairs = CODES_8B10B[:, :, None] | CODES_8B10B[after].astype(np.uint32) << 10
    for shown in (pairs, ~pairs & 0xFFFFF):  # bits that end a run of five, of six
        five = shown & shown >> 1 & shown >> 2 & shown >> 3 & shown >> 4
        assert five.any() and not (five & shown >> 5).any()
    assert CATALOGUE["8b10b"].run_limit == 5


def test_8b10b_carries_the_disparity_of_each_cell_on():
    rng = np.random.default_rng(1)
    values = rng.integers(0, 256, (40, 30), dtype=np.uint8)
    at_once = encode_line("8b10b", values)
    state = np.zeros(30, bool)
    assert (np.vstack([encode_line("8b10b", v[None], state) for v in values]) == at_once).all()
    walk = np.cumsum(np.where(at_once, 1, -1), axis=0) - 1  # from the disparity of -1
    assert walk.max() == 3 and walk.min() == -3
    assert set(np.unique(walk[9::10])) == {-1, 1}
    assert ((walk[-1] == 1) == state).all()


def test_4b6b_is_balanced_and_runs_to_four():
    codes = [text(code, 6) for code in CODES_4B6B]
    assert len(set(codes)) == 16 and all(code.count("1") == 3 for code in codes)
    assert codes[0] == "001110" and codes[15] == "101100"
    assert max(longest(a + b) for a in codes for b in codes) == CATALOGUE["4b6b"].run_limit == 4


@pytest.mark.parametrize("line", BALANCED)
def test_random_data_stays_within_the_run_limit(line):
    rng = np.random.default_rng(2)
    values = rng.integers(0, 1 << CATALOGUE[line].bits, (400, 8), dtype=np.uint8)
    shown = encode_line(line, values)
    runs = [longest("".join("01"[int(bit)] for bit in lane)) for lane in shown.T]
    assert max(runs) == CATALOGUE[line].run_limit
    assert (
        abs(shown.mean() - 0.5) < 1e-3 + (line == "8b10b") * 2e-4
    )  # exact, but for +-1 at its end


@pytest.mark.parametrize("line", LINE_CODES)
def test_every_code_is_read(line):
    every = np.arange(1 << CATALOGUE[line].bits, dtype=np.uint8)
    for disparity in (False, True):
        state = np.full(len(every), disparity)
        shown = encode_line(line, every[None], state if line == "8b10b" else None)
        values, margin = decode_line(line, soft_of(shown))
        assert (values[0] == every).all()
        # Two codewords differ in at least one symbol, in two where the code is balanced.
        assert (margin >= (4.0 if line in ("none", "scrambled", "8b10b") else 8.0)).all()


@pytest.mark.parametrize("line", LINE_CODES)
def test_reading_is_maximum_likelihood(line):
    """Against all codewords tried one by one, where most received words are no codeword."""
    rng = np.random.default_rng(3)
    symbols, count = CATALOGUE[line].symbols, 1 << CATALOGUE[line].bits
    soft = rng.normal(0, 2, (3 * symbols, 150)).astype(np.float32)
    every = np.arange(count, dtype=np.uint8)[None]
    states = [np.full(count, s) for s in ((False, True) if line == "8b10b" else (False,))]
    books = np.stack([encode_line(line, every, state) for state in states]).astype(float)
    scores = np.einsum("dsv,gsc->dgvc", books, soft.reshape(3, symbols, -1)).max(axis=0)
    values, margin = decode_line(line, soft)
    assert (values == scores.argmax(axis=1)).all()
    ordered = np.sort(scores, axis=1)
    assert np.allclose(margin, ordered[:, -1] - ordered[:, -2], atol=1e-4)


@pytest.mark.parametrize("line", LINE_CODES)
def test_margins_are_log_odds(line):
    """Through a Gaussian channel, whose soft values are true log-likelihood ratios: a decision with
    margin m is wrong at least as often as its nearest rival is right, 1 / (1 + e^m), and at most
    as often as if all of up to 255 rivals were as near."""
    rng = np.random.default_rng(4)
    values = rng.integers(0, 1 << CATALOGUE[line].bits, (20, 1000), dtype=np.uint8)
    shown = encode_line(line, values)
    noise = 0.5
    seen = np.where(shown, 1.0, -1.0) + rng.normal(0, noise, shown.shape)
    read, margin = decode_line(line, (2 * seen / noise**2).astype(np.float32))
    wrong = read != values
    expected = 1 / (1 + np.exp(margin.astype(float)))
    spread = 5 * np.sqrt((expected * (1 - expected)).sum())
    assert wrong.sum() > expected.sum() - spread
    sure = margin > 6
    assert sure.sum() > 100 and wrong[sure].mean() < 255 * np.exp(-6)


def test_what_is_no_number_says_nothing():
    for line in LINE_CODES:
        soft = soft_of(encode_line(line, np.ones((1, 3), np.uint8)))
        soft[:, 0] = np.nan
        soft[:, 1] *= np.inf
        values, margin = decode_line(line, soft)
        assert margin[0, 0] == 0 and values[0, 1] == values[0, 2] == 1
        assert np.isfinite(margin).all() and margin[0, 1] > 1e3


def test_values_and_shapes_that_cannot_be():
    with pytest.raises(ValueError, match="values of 4b6b must be below 16"):
        encode_line("4b6b", np.full((1, 1), 16, np.uint8))
    with pytest.raises(ValueError, match=r"soft must be \(groups \* 10, cells\)"):
        decode_line("8b10b", np.zeros((11, 2), np.float32))
