"""Comparison of the cells of a build, counted by yosys, with those of the device."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import NamedTuple

from rtl_model.gateware.design import Design
from rtl_model.gateware.top import TOP
from rtl_model.synthesis import synthesise


class Fit(NamedTuple):
    """Cells of a build, and those of the device (`*_of`).

    Placement is not computed, so a build near 100 % may still fail.

    Attributes:
        luts: look-up tables. In an ECP5 each cell of a carry chain counts as two.
        flip_flops: flip-flops.
        block_rams: block RAMs of 18 kbit; one of 36 kbit counts as two.
    """

    luts: int
    luts_of: int
    flip_flops: int
    flip_flops_of: int
    block_rams: int
    block_rams_of: int

    @property
    def ok(self) -> bool:
        """Whether the device has enough cells of each kind."""
        return (
            self.luts <= self.luts_of
            and self.flip_flops <= self.flip_flops_of
            and self.block_rams <= self.block_rams_of
        )


def fit(design: Design) -> Fit:
    """Synthesises the top module of a design with yosys. Raises InputError if yosys is missing."""
    device = design.target.device
    with tempfile.TemporaryDirectory() as folder:
        for name, text in design.files().items():
            (Path(folder) / name).write_text(text, encoding="utf-8")
        cells = synthesise(device.family, top=TOP, settings={}, sources=Path(folder))
    ecp5 = device.family == "ecp5"
    return Fit(
        luts=cells.luts + (2 * cells.carries if ecp5 else 0),
        luts_of=device.luts,
        flip_flops=cells.flip_flops,
        flip_flops_of=device.flip_flops,
        block_rams=cells.block_rams + cells.large_block_rams,
        block_rams_of=device.block_rams,
    )
