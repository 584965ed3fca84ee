"""Throughput of the Reed-Solomon code, in bits of data, by the wrong bytes of a word.

There is no plain form: a second decoder stands in the tests only.
"""

from __future__ import annotations

from functools import partial
from typing import Final

import numpy as np

from cosim.run.timing import Row
from link.coding.reed_solomon import WORD_BYTES, ReedSolomon
from scenarios.studies.bench.words import AIM, code_rows

PARITY: Final = 32
WRONG: Final = (0, 4, 16)
"""Wrong bytes of a word."""
WORDS, TURNS = 4096, 3


def reed_solomon_rows() -> list[Row]:
    """The rows `link.reed-solomon`: encoding, and decoding by the wrong bytes of a word."""
    code, random = ReedSolomon(PARITY), np.random.default_rng(1)
    data = random.integers(0, 256, (WORDS, code.data_bytes), dtype=np.uint8)
    sent, bits = code.encode(data), 8 * data.size
    name = "link.reed-solomon"
    rows = code_rows(name, "encode", partial(code.encode, data), bits, AIM, TURNS)
    for wrong in WRONG:
        seen = sent.copy()
        place = random.permuted(np.tile(np.arange(WORD_BYTES), (WORDS, 1)), axis=1)[:, :wrong]
        seen[np.arange(WORDS)[:, None], place] ^= random.integers(
            1, 256, place.shape, dtype=np.uint8
        )
        what = f"decode, {wrong} of {WORD_BYTES} bytes wrong"
        rows += code_rows(name, what, partial(code.decode, seen), bits, AIM, TURNS)
    return rows
