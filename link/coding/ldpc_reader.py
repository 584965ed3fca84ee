"""Reading of LDPC words from soft values of bits."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from cosim.compute.opencl import Device
from link.coding.adaptive_blocks import AdaptiveBlocks
from link.coding.soft_blocks import SoftBlocks
from link.coding.soft_blocks_compiled import mark_changed
from link.coding.word_reader import ReadWords


class LdpcReader:
    """Reads the words of blocks; see `WordReader`.

    Args:
        form: form of the blocks.
        device: OpenCL device of the decoder; None for the compiled form, with the same bits.
    """

    def __init__(self, form: SoftBlocks, device: Device | None = None) -> None:
        self._form, self._device = form, device
        self._soft = np.zeros((form.groups, form.layout.group, form.layout.cells), np.int8)

    def store(self, group: int, within: int, soft: npt.NDArray[np.float32]) -> None:
        self._form.store(soft, group, self._soft[within])

    def read(self, block: int, missing: Sequence[int]) -> ReadWords:
        self._soft[missing] = 0
        form = self._form
        if isinstance(form, AdaptiveBlocks):
            number = form.read_header(self._soft)
            form = form.at(form.number if number is None else number)
        soft = form.collect(self._soft)
        data, ok, rounds = form.code.decode(soft, device=self._device)
        sent = form.code.encode(data)
        changed = np.empty_like(sent)
        mark_changed(soft.view(np.uint64), sent, ok, changed)
        count = int(np.count_nonzero(changed))
        return ReadWords(data, ok, ok.copy(), changed, count, int(rounds.sum()), form)
