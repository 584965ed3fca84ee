"""Philox4x32-10 against the test vectors and the code of its authors."""

from __future__ import annotations

from importlib.resources import files

import numpy as np
import pytest

from cosim.compute.philox import philox4x32, philox_cl

# Random123's known-answer file (kat_vectors, philox4x32-10): counter, key, answer.
VECTORS = [
    ((0, 0, 0, 0), (0, 0), (0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8)),
    (
        (0xFFFFFFFF,) * 4,
        (0xFFFFFFFF, 0xFFFFFFFF),
        (0x408F276D, 0x41C83B0E, 0xA20BC7C6, 0x6D5451FD),
    ),
    (
        (0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344),  # digits of pi
        (0xA4093822, 0x299F31D0),
        (0xD16CFE09, 0x94FDCCEB, 0x5001E420, 0x24126EA1),
    ),
]

OURS = """
kernel void ours(global const uint *c, global uint *out, uint k0, uint k1)
{
    const size_t n = get_global_size(0), i = get_global_id(0);
    ulong16 w0 = convert_ulong16(vload16(i, c));
    ulong16 w1 = convert_ulong16(vload16(i + n, c));
    ulong16 w2 = convert_ulong16(vload16(i + 2 * n, c));
    ulong16 w3 = convert_ulong16(vload16(i + 3 * n, c));
    philox16(&w0, &w1, &w2, &w3, k0, k1);
    vstore16(convert_uint16(w0), i, out);
    vstore16(convert_uint16(w1), i + n, out);
    vstore16(convert_uint16(w2), i + 2 * n, out);
    vstore16(convert_uint16(w3), i + 3 * n, out);
}
"""

# The header of Random123 itself, as pyopencl ships it.
THEIRS = """
#include "philox.cl"
kernel void theirs(global const uint *c, global uint *out, uint k0, uint k1)
{
    const size_t n = get_global_size(0), i = get_global_id(0);
    philox4x32_ctr_t counter = {{c[i], c[i + n], c[i + 2 * n], c[i + 3 * n]}};
    philox4x32_key_t key = {{k0, k1}};
    counter = philox4x32(counter, key);
    for (int w = 0; w < 4; w++)
        out[i + w * n] = counter.v[w];
}
"""


@pytest.fixture(scope="module")
def counters() -> np.ndarray:
    """(4, 1e5) uint32, the test vectors first."""
    words = np.random.default_rng(1).integers(0, 2**32, (4, 100_000), np.uint32)
    words[:, : len(VECTORS)] = np.transpose([counter for counter, _, _ in VECTORS])
    return words


@pytest.mark.parametrize(("counter", "key", "answer"), VECTORS)
def test_the_authors_vectors_come_out(counter, key, answer) -> None:
    words = philox4x32(counter, key)
    assert tuple(int(w) for w in words) == answer
    assert all(w.dtype == np.uint32 for w in words)


def test_counters_broadcast() -> None:
    pixels, draws = np.arange(5)[:, None], np.arange(3)
    words = philox4x32((pixels, 7, 8, draws), (1, 2))
    assert all(w.shape == (5, 3) for w in words)
    alone = philox4x32((4, 7, 8, 2), (1, 2))
    assert [w[4, 2] for w in words] == list(alone)


@pytest.mark.parametrize("form", ["ours", "theirs"])
@pytest.mark.parametrize("key", [key for _, key, _ in VECTORS])
def test_opencl_numpy_and_the_authors_header_agree_on_every_bit(
    device, counters: np.ndarray, form: str, key: tuple[int, int], monkeypatch: pytest.MonkeyPatch
) -> None:
    # The path of a clone may have blanks, in which PoCL's compiler finds nothing to include.
    monkeypatch.chdir(files("pyopencl") / "cl/pyopencl-random123")
    source, lanes = (philox_cl() + OURS, 16) if form == "ours" else (THEIRS, 1)
    kernel = device.kernel(source, form, ("-cl-std=CL1.2", "-I", "."))
    out = device.upload(np.zeros_like(counters))
    size = (counters.shape[1] // lanes,)
    kernel(device.queue, size, None, device.upload(counters), out, *map(np.uint32, key))
    given = device.download(out, np.empty_like(counters))
    np.testing.assert_array_equal(given, philox4x32(tuple(counters), key))
