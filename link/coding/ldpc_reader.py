"""Reading of LDPC words from soft values of bits."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from cosim.compute.opencl import Device
from link.coding.ldpc import quantise
from link.coding.soft_blocks import SoftBlocks
from link.coding.word_reader import ReadWords

__all__ = ["LdpcReader"]


class LdpcReader:
    """Reads the words of blocks; see `WordReader`.

    Args:
        form: of the blocks.
        device: OpenCL device of the decoder; None for the compiled form, with the same bits.
    """

    def __init__(self, form: SoftBlocks, device: Device | None = None) -> None:
        self._form, self._code, self._device = form, form.code, device
        self._soft = np.zeros((form.groups, form.layout.group, form.layout.cells), np.int8)

    def store(self, group: int, within: int, soft: npt.NDArray[np.float32]) -> None:
        np.multiply(quantise(soft), self._form.signs(group), out=self._soft[within])

    def read(self, block: int, missing: Sequence[int]) -> ReadWords:
        self._soft[missing] = 0
        soft = self._form.collect(self._soft)
        data, ok, rounds = self._code.decode(soft, device=self._device)
        sent = self._code.encode(data)
        # Bits without a soft value were not decided, so none of them was decided wrongly.
        changed = np.packbits(soft > 0, axis=1, bitorder="little") ^ sent
        changed &= np.packbits(soft != 0, axis=1, bitorder="little")
        changed[~ok] = 0
        bits = np.unpackbits(changed, axis=1, bitorder="little").view(np.bool_)
        count = int(np.count_nonzero(changed))
        return ReadWords(data, ok, ok.copy(), bits, count, int(rounds.sum()))
