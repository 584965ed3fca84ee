"""The first difference between Verilog and cycle model, and the command that reproduces it."""

from __future__ import annotations

import shlex
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cosim.errors import one_line
from rtl_model.cycle import Tiles
from rtl_model.lockstep.program import Program


@dataclass
class Difference:
    """A difference.

    Attributes:
        program: program of the run.
        what: the value that differs: "spike", "tile" or a field of a tile, after "the sink's " for
            one of the sink; or the name of a register.
        clock: edge at which the tile was computed, or the read strobed.
        frame, row, column: frame, row and column of the pixel; None for a register.
        verilog, model: the two values; None for a missing tile.
        until: clock after which the difference is visible.
        waves: file of waveforms, None if not written.
        view: GTKWave's view of them, None if not written.
        sources: folder of the Verilog; None for the design's.
    """

    program: Program
    what: str
    clock: int
    frame: int | None
    row: int | None
    column: int | None
    verilog: int | None
    model: int | None
    until: int
    waves: Path | None = None
    view: Path | None = None
    sources: Path | None = None

    @property
    def reproducer(self) -> str:
        """The command that reproduces the difference."""
        program = self.program
        return (
            f"viform board compare --lockstep --rows {program.rows} --columns {program.columns} "
            f"--lanes {program.lanes} --seed {program.seed} --until {self.until}"
            + ("" if self.sources is None else f" --sources {shlex.quote(str(self.sources))}")
        )

    def __str__(self) -> str:
        place = f"clock {self.clock}"
        if self.frame is not None:
            place += f", frame {self.frame}, row {self.row}, column {self.column}"
        lines = [
            f"{place}: {self.what} is {_value(self.verilog)} in the Verilog, "
            f"{_value(self.model)} in the model",
            f"reproduce: {self.reproducer}",
        ]
        if self.waves is not None:
            lines.append(one_line(f"waveforms: {self.waves}, displayed by `gtkwave {self.view}`"))
        return "\n".join(lines)


def _value(value: int | None) -> str:
    if value is None:
        return "missing"
    return str(value) if value < 10 else f"{value} (0x{value:x})"


def first_difference(program: Program, verilog: Tiles, model: Tiles, what: str) -> Difference:
    """The first difference of two unequal lists of tiles.

    Args:
        program: program of the run.
        verilog, model: the lists.
        what: prefix of the field's name, "" for tiles of the pixels.
    """
    count = min(len(verilog), len(model))
    unequal = np.flatnonzero(verilog[:count] != model[:count])
    at = int(unequal[0]) if unequal.size else count
    here = None if at >= len(verilog) else verilog[at]
    there = None if at >= len(model) else model[at]
    lanes = program.lanes

    def difference(name: str, tile: np.void, one: int | None, two: int | None, bit: int = 0):  # type: ignore[no-untyped-def]
        clock = int(tile["clock"]) & 0xFFFFFFFF if one is None else int(tile["clock"])
        return Difference(
            program,
            f"{what}{name}",
            clock,
            int(tile["frame"]),
            int(tile["row"]),
            int(tile["tile"]) * lanes + bit,
            one,
            two,
            clock + 1,
        )

    if there is not None and (here is None or there["clock"] < here["clock"]):
        return difference("tile", there, None, int(there["bits"]))  # the model has one more
    if here is not None and (there is None or here["clock"] < there["clock"]):
        return difference("tile", here, int(here["bits"]), None)
    assert here is not None and there is not None, "the lists are equal"
    for name in ("clock", "frame", "row", "tile"):
        if here[name] != there[name]:
            return difference(f"{name} of the tile", there, int(here[name]), int(there[name]))
    wrong = int(here["bits"]) ^ int(there["bits"])
    bit = (wrong & -wrong).bit_length() - 1
    one, two = (int(tile["bits"]) >> bit & 1 for tile in (here, there))
    return difference("spike", there, one, two, bit)
