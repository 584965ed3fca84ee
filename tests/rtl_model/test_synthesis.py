"""Upper limits of the cells of the 32 x 32 build in three families."""

import shutil

import pytest

from cosim import InputError
from rtl_model import synthesis
from rtl_model.events.encoder import EventSize
from rtl_model.synthesis import Cells, synthesise

needs_yosys = pytest.mark.skipif(
    shutil.which("yosys") is None, reason="needs the system package yosys"
)

# About 10 % over what yosys 0.23 gives; block RAM exactly, since memories must be nothing else.
PIXELS = Cells("ice40", luts=562, flip_flops=87, block_rams=5, distributed_rams=0, carries=250)

CEILINGS = {
    "ice40": Cells("ice40", 9190, 2430, block_rams=84, distributed_rams=0, carries=3460),
    "ecp5": Cells("ecp5", 8290, 2640, block_rams=36, distributed_rams=0, carries=2060),
    "xc7": Cells(
        "xc7", 6100, 2480, block_rams=23, distributed_rams=0, carries=1050, large_block_rams=13
    ),
}

EVENTS = {
    ("encoder", "ice40"): Cells("ice40", 1130, 410, 8, 0, 210),
    ("encoder", "ecp5"): Cells("ecp5", 1350, 410, 3, 0, 120),
    ("encoder", "xc7"): Cells("xc7", 890, 410, 2, 0, 57, large_block_rams=1),
    ("decoder", "ice40"): Cells("ice40", 655, 485, 36, 0, 133),
    ("decoder", "ecp5"): Cells("ecp5", 550, 485, 9, 0, 74),
    ("decoder", "xc7"): Cells("xc7", 492, 485, 5, 0, 36, large_block_rams=4),
}
"""32 x 32 pixels, packets of 128 cycles, a queue of 256 entries."""


def within(cells: Cells, ceiling: Cells) -> bool:
    """Whether a build has at most `ceiling` cells of each kind."""
    return (
        cells.family == ceiling.family
        and 0 < cells.luts <= ceiling.luts
        and 0 < cells.flip_flops <= ceiling.flip_flops
        and cells.block_rams == ceiling.block_rams
        and cells.large_block_rams == ceiling.large_block_rams
        and cells.distributed_rams <= ceiling.distributed_rams
        and 0 < cells.carries <= ceiling.carries
    )


@needs_yosys
@pytest.mark.slow
@pytest.mark.parametrize("family", sorted(CEILINGS))
def test_the_board_keeps_below_its_ceiling(family):
    cells = synthesise(family)
    assert within(cells, CEILINGS[family]), cells


@needs_yosys
@pytest.mark.slow
@pytest.mark.parametrize(("module", "family"), sorted(EVENTS))
def test_the_event_path_keeps_below_its_ceiling(module, family):
    top = f"viform_event_{module}"
    text = (synthesis.VERILOG / f"{top}.v").read_text()
    settings = {n: value for n, value in EventSize().verilog.items() if f"] {n} =" in text}
    cells = synthesise(family, top=top, settings=settings)
    assert within(cells, EVENTS[module, family]), cells


@needs_yosys
def test_four_pixels_keep_below_their_ceiling_and_lie_in_block_ram():
    """256 deep: 32 bits of pattern and 48 of charge, 16 bits wide blocks of the ice40."""
    settings = {"DEPTH": 256, "ADDRESS_BITS": 8}
    cells = synthesise("ice40", top="viform_pixels", settings=settings)
    assert within(cells, PIXELS), cells


@needs_yosys
def test_what_yosys_refuses_is_one_line():
    with pytest.raises(InputError, match="must be accepted by yosys, not ERROR"):
        synthesise("ice40", top="viform_nothing", settings={})


@needs_yosys
def test_a_yosys_that_takes_too_long_is_one_line():
    with pytest.raises(InputError, match=r"must be done within 0\.01 s, not still running"):
        synthesise("ice40", timeout_s=0.01)


def test_a_missing_yosys_is_one_line(monkeypatch):
    monkeypatch.setattr(synthesis.shutil, "which", lambda name: None)
    with pytest.raises(InputError, match="apt-get install yosys"):
        synthesise("ice40")
