"""Throughput of the low-density parity-check codes in bits of data, over all cores and per core.

Words are decoded from noise in which the rate of the code is a fixed share of what the channel
carries, because the number of rounds depends on it. The plain implementation is the numpy form.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, Final

import numpy as np

from cosim.compute.opencl import Device
from cosim.run.timing import Row
from link.coding.ldpc import ROUNDS, Ldpc, quantise
from link.coding.ldpc_numpy import decode_in_numpy
from scenarios.studies.bench.words import AIM, code_rows

DATA_BITS: Final = 8448
CODES: Final = {9216: 0.4000, 9600: 0.4687, 10368: 0.5539}
"""Bits of a word as sent -> standard deviation of the noise on signs of +-1 in which the rate is
.94 of the capacity."""
WORDS, PLAIN_WORDS, TURNS = 512, 8, 3


def _row(what: str, call: Callable[[], Any], plain: Callable[[], Any] | None) -> list[Row]:
    """The rows of a call for WORDS words."""
    share = None if plain is None else (plain, PLAIN_WORDS / WORDS)
    return code_rows("link.ldpc", what, call, WORDS * DATA_BITS, AIM, TURNS, share)


def ldpc_rows(device: Device | None) -> list[Row]:
    """The rows `link.ldpc`: encoding at the first rate, and decoding at each.

    Args:
        device: OpenCL device that decodes; None for the compiled form.
    """
    random = np.random.default_rng(1)
    rows: list[Row] = []
    for word_bits, noise in CODES.items():
        code = Ldpc(DATA_BITS, word_bits)
        data = random.integers(0, 256, (WORDS, DATA_BITS // 8), dtype=np.uint8)
        if not rows:
            rows += _row("encode", partial(code.encode, data), None)
        seen = np.unpackbits(code.encode(data), axis=1, bitorder="little") * np.float32(2) - 1
        seen += np.float32(noise) * random.standard_normal(seen.shape, np.float32)
        soft = quantise(seen * np.float32(2 / noise**2))
        ours = partial(code.decode, soft, ROUNDS, device)
        plain = partial(decode_in_numpy, code, soft[:PLAIN_WORDS], ROUNDS)
        rows += _row(f"decode, rate {code.rate:.3f}", ours, plain)
    return rows
