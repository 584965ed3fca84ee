"""Low-density parity-check codes: parity, the forms of the decoder, the bounds of its input.

The base graphs: their size and structure, and the sets of lifting sizes.
"""

import itertools
from dataclasses import replace
from importlib.resources import files
from types import SimpleNamespace

import fastcrc
import numpy as np
import pytest

from cosim.errors import InputError
from link.coding.ldpc import LIFTINGS, ROUNDS, Ldpc, base_graph, quantise
from link.coding.ldpc_decoding import SOFT, decode_in_numpy
from tests.link.coding.ldpc_channel import noise_at, sent

SHAPES = {1: (46, 68, 22, 316), 2: (42, 52, 10, 197)}
"""Rows, columns, columns of data, edges (TS 38.212, clause 5.3.2)."""
CRC32C = {1: 0xB1A47CB5, 2: 0x5738A915}
"""Of the tables as they were compared with a second copy."""


def four_cycles(graph, lifting):
    """Closed paths of four edges in the lifted graph, in units of the lifting size."""
    rows = [{} for _ in range(graph.rows)]
    for row, column, values in zip(graph.row, graph.column, graph.values, strict=True):
        rows[row][int(column)] = values[LIFTINGS[lifting]] % lifting
    found = 0
    for a, b in itertools.combinations(rows, 2):
        turns = [(a[c] - b[c]) % lifting for c in a.keys() & b.keys()]
        found += len(turns) - len(set(turns))
    return found


def test_the_lifting_sizes_are_those_of_the_standard():
    assert len(LIFTINGS) == 51 and min(LIFTINGS) == 2 and max(LIFTINGS) == 384
    last = {z: s for z, s in LIFTINGS.items() if 2 * z not in LIFTINGS}
    assert last == {256: 0, 384: 1, 320: 2, 224: 3, 288: 4, 352: 5, 208: 6, 240: 7}
    assert all(LIFTINGS[2 * z] == s for z, s in LIFTINGS.items() if z not in last)


@pytest.mark.parametrize("number", SHAPES)
def test_the_tables_are_those_that_were_compared(number):
    graph = base_graph(number)
    shape = graph.rows, graph.column.max() + 1, graph.data_columns, len(graph.row)
    assert shape == SHAPES[number]
    text = (files("link.coding") / f"ldpc_graph_{number}.csv").read_bytes()
    assert fastcrc.crc32.iscsi(text) == CRC32C[number]
    assert len(set(zip(graph.row, graph.column, strict=True))) == len(graph.row)
    assert (np.diff(graph.row) >= 0).all()
    assert graph.values.min() == 0 and graph.values.max() < 384


@pytest.mark.parametrize("number", SHAPES)
def test_every_row_has_the_parity_column_that_it_gives(number):
    graph = base_graph(number)
    first = graph.data_columns
    for row in range(graph.rows):
        if row == 3:
            continue
        here = (graph.row == row) & (graph.column == first + row + (row < 3))
        assert (graph.values[here] == 0).all() and here.sum() == 1
        later = graph.column[(graph.row > row) & (graph.row != 3)]
        assert row < 3 or first + row not in later
    core = graph.values[(graph.row < 4) & (graph.column == first)]
    assert len(core) == 3
    for three in core.T:
        assert len(set(three.tolist())) == 2


@pytest.mark.parametrize("number", SHAPES)
@pytest.mark.parametrize("lifting", [256, 288, 320, 352, 384])
def test_no_four_bits_and_checks_are_a_cycle(number, lifting):
    assert four_cycles(base_graph(number), lifting) == 0


def test_there_is_no_third_graph():
    with pytest.raises(ValueError, match="graph must be 1 or 2, not 3"):
        base_graph(3)


FULL = [(8448, 9216), (8448, 9600), (8448, 10368)]
"""Data and sent bits of the codes of the link."""
ONE_OF_EACH_SET = [32, 48, 40, 56, 72, 88, 104, 120]


def matrix(code):
    """The parity-check matrix, (checks, bits) uint8."""
    z = np.arange(code.lifting)
    row, column, shift = code.edges
    out = np.zeros(((row.max() + 1) * code.lifting, code.columns * code.lifting), np.uint8)
    for r, c, s in zip(row, column, shift, strict=True):
        out[r * code.lifting + z, c * code.lifting + (z + s) % code.lifting] ^= 1
    return out


def whole(code, data):
    """All bits of words, sent or not, (words, bits), and which of them are known, (bits,)."""
    word = np.unpackbits(code.encode(data), axis=1, bitorder="little")
    bits = np.unpackbits(data, axis=1, bitorder="little")
    assert (word[:, : code.sent_data] == bits[:, code.data_bits - code.sent_data :]).all()
    out = np.zeros((len(data), code.columns * code.lifting), np.uint8)
    out[:, : code.data_bits] = bits
    first, parity = code.data_columns * code.lifting, word[:, code.sent_data :]
    out[:, first : first + parity.shape[1]] = parity
    return out, np.arange(out.shape[1]) < first + parity.shape[1]


def check_words(code):
    data = np.random.default_rng(0).integers(0, 256, (3, code.data_bits // 8), dtype=np.uint8)
    bits, known = whole(code, data)
    checks = matrix(code)
    checks = checks[~checks[:, ~known].any(axis=1)]
    assert len(checks) > (4 if known.all() else 3) * code.lifting - code.lifting
    assert not ((checks.astype(np.int32) @ bits.T) % 2).any()


def same(code, soft, rounds, device=None):
    """The golden form's answer, after comparing all others with it."""
    expected = decode_in_numpy(code, soft, rounds)
    for form in (None, device) if device else (None,):
        for a, b in zip(code.decode(soft, rounds, form), expected, strict=True):
            np.testing.assert_array_equal(a, b)
    return expected


@pytest.mark.parametrize("graph", [1, 2])
@pytest.mark.parametrize("lifting", ONE_OF_EACH_SET)
def test_all_checks_hold_in_all_sets(graph, lifting):
    data_bits = base_graph(graph).data_columns * lifting
    check_words(Ldpc(data_bits, data_bits + 8 * lifting, lifting=lifting, graph=graph))


@pytest.mark.parametrize(
    ("data_bits", "word_bits", "lifting"),
    [(88, 200, 13), (152, 160, 7), (1000, 3000, 60), (8000, 9600, 384), (8448, 8896, 384)],
)
def test_all_checks_hold_whatever_is_not_sent(data_bits, word_bits, lifting):
    check_words(Ldpc(data_bits, word_bits, lifting=lifting))


@pytest.mark.parametrize("graph", [1, 2])
def test_all_checks_hold_in_the_whole_graph(graph):
    base = base_graph(graph)
    lifting = 8
    data_bits = base.data_columns * lifting
    word_bits = data_bits + (base.rows - 2) * lifting
    check_words(Ldpc(data_bits, word_bits, lifting=lifting, graph=graph))


def test_codes_of_a_rate_and_of_the_smallest_lifting():
    code = Ldpc.of_rate(11 / 12)
    assert (code.data_bits, code.word_bits, code.lifting) == (8448, 9216, 384)
    assert code.rate == 11 / 12
    assert Ldpc.of_rate(0.95).rate <= 0.95 < 8448 / (Ldpc.of_rate(0.95).word_bits - 8)
    assert Ldpc(6144, 12288).lifting == 288  # 22 Z >= 6144
    assert Ldpc(512, 1024, graph=2).lifting == 52


@pytest.mark.parametrize(("data_bits", "word_bits"), [*FULL, (8000, 9600), (8448, 8896)])
def test_all_forms_of_the_decoder_agree(device, data_bits, word_bits):
    code = Ldpc(data_bits, word_bits)
    near = noise_at(0.97, min(code.rate, 0.95))
    data, soft = sent(code, 6, near, 1)
    noisy = quantise(soft)
    noisy[3, ::9] = 0  # erasures
    noisy[4] = np.random.default_rng(2).integers(-128, 128, word_bits)
    noisy[5] *= 4
    read, ok, spent = same(code, noisy, 12, device)
    assert (read[ok] == data[ok]).all() and not ok[4] and spent[4] == 12


def test_a_gpu_shares_a_word_among_work_items(device):
    """As a GPU runs it: many work-items and short vectors."""
    code = Ldpc(8000, 9600)
    _, soft = sent(code, 8, noise_at(0.95, code.rate), 3)
    gpu = replace(device)
    gpu.__dict__["gpu"] = True
    same(code, quantise(soft), 10, gpu)


def test_messages_beyond_the_local_memory_of_a_gpu(device, monkeypatch):
    monkeypatch.setattr("link.coding.ldpc_opencl._WORDS", 3)
    code = Ldpc(8000, 9600)
    _, soft = sent(code, 8, noise_at(0.95, code.rate), 3)
    gpu = replace(device, handle=SimpleNamespace(local_mem_size=24_000, driver_version="1"))
    gpu.__dict__.update(gpu=True, context=device.context, queue=device.queue)
    same(code, quantise(soft), 10, gpu)


@pytest.mark.parametrize("graph", [1, 2])
def test_all_forms_agree_at_low_rates(device, graph):
    code = Ldpc(640, 1600, graph=graph, lifting=64)
    _, soft = sent(code, 12, noise_at(0.8, code.rate), 4)
    same(code, quantise(soft), ROUNDS, device)
    odd = Ldpc(88, 200, lifting=13)
    _, soft = sent(odd, 12, noise_at(0.6, odd.rate), 5)
    same(odd, quantise(soft), ROUNDS)


def test_words_without_noise_need_few_rounds():
    for data_bits, word_bits in FULL:
        code = Ldpc(data_bits, word_bits)
        data, soft = sent(code, 4, 0.1, 6)
        read, ok, spent = code.decode(quantise(soft))
        assert ok.all() and (read == data).all() and spent.max() <= 2


def test_sums_at_their_limit_do_not_turn_over():
    """Words that one round decodes stay so, although most of their values are at the limit."""
    code = Ldpc(1000, 3000, lifting=64)
    rng = np.random.default_rng(7)
    data = rng.integers(0, 256, (200, 125), dtype=np.uint8)
    bits = np.unpackbits(code.encode(data), axis=1, bitorder="little")
    read, ok, _ = code.decode(quantise(5 * (bits * 2.0 - 1) + rng.normal(0, 2, bits.shape)))
    assert ok.all() and (read == data).all()


def test_erasures_are_filled_in_and_a_word_of_them_is_no_word():
    """Up to .7 of the bits that parity could replace at best."""
    rng = np.random.default_rng(8)
    for data_bits, word_bits in FULL:
        code = Ldpc(data_bits, word_bits)
        data, soft = sent(code, 20, 0.1, 9)
        given = quantise(soft)
        for word in given:
            word[rng.permutation(word_bits)[: int((word_bits - data_bits) * 0.7)]] = 0
        read, ok, _ = code.decode(given)
        assert ok.all() and (read == data).all()
        assert not code.decode(np.zeros((2, word_bits), np.int8))[1].any()


@pytest.mark.parametrize("share", [0.93, 0.94])
def test_no_word_of_768_fails_near_the_capacity(share):
    for data_bits, word_bits in FULL:
        code = Ldpc(data_bits, word_bits)
        data, soft = sent(code, 768, noise_at(share, code.rate), 10)
        read, ok, _ = code.decode(quantise(soft))
        assert ok.all() and (read == data).all()


def test_a_device_with_little_memory_is_refused(device):
    small = replace(device, handle=SimpleNamespace(local_mem_size=1024))
    small.__dict__["gpu"] = False
    with pytest.raises(InputError, match="must be one with 44164 bytes of local memory, not"):
        Ldpc(8448, 9216).decode(np.zeros((1, 9216), np.int8), 5, small)


def test_quantised_values():
    given = np.array([[0, 0.1, -0.13, 1, -7.9, np.nan, np.inf, -np.inf]])
    assert quantise(given).tolist() == [[0, 0, -1, 4, -SOFT, 0, SOFT, -SOFT]]
    assert quantise(given, 2).tolist() == [[0, 0, 0, 2, -16, 0, SOFT, -SOFT]]


def test_no_words(device):
    code = Ldpc(8448, 9216)
    assert code.encode(np.zeros((0, 1056))).shape == (0, 1152)
    for form in (None, device):
        assert [len(a) for a in code.decode(np.zeros((0, 9216), np.int8), 5, form)] == [0, 0, 0]


def test_what_cannot_be(device):
    for given, message in (
        ((8448, 9216, 383), "lifting must be one of table 5.3.2-1 of TS 38.212, not 383"),
        ((8449, 9216, 384), "data_bits must be a multiple of 8, 769 to 8448 with lifting 384"),
        ((768, 9216, 384), "data_bits must be a multiple of 8, 769 to 8448 with lifting 384"),
        ((8456, 9216, None), "data_bits must be a multiple of 8, 769 to 8448 with lifting 384"),
        ((8448, 8448, 384), "word_bits must be a multiple of 8, 8449 to 25344 with data_bits 8448"),
        ((8448, 25352, 384), "word_bits must be a multiple of 8, 8449 to 25344"),
        ((8448, 9220, 384), "word_bits must be a multiple of 8, 8449 to 25344"),
    ):
        with pytest.raises(ValueError, match=message):
            Ldpc(given[0], given[1], lifting=given[2])
    for rate in (0, 1, float("nan")):
        with pytest.raises(ValueError, match="rate must be above 0 and below 1"):
            Ldpc.of_rate(rate)
    code = Ldpc(8448, 9216)
    with pytest.raises(ValueError, match=r"data must be \(words, 1056\), not \(1, 1055\)"):
        code.encode(np.zeros((1, 1055)))
    for soft in (np.zeros((1, 9215), np.int8), np.zeros(9216, np.int8), np.zeros((1, 9216))):
        with pytest.raises(ValueError, match=r"soft must be \(words, 9216\) int8"):
            code.decode(soft)
    with pytest.raises(ValueError, match="rounds must be 1 or more, not 0"):
        code.decode(np.zeros((1, 9216), np.int8), 0)
    with pytest.raises(ValueError, match="lifting must be a multiple of 16 on a device, not 13"):
        Ldpc(88, 200, lifting=13).decode(np.zeros((1, 200), np.int8), 5, device)
    assert all(lifting % 16 == 0 for lifting in LIFTINGS if lifting > 240)
