"""What a build costs in an FPGA: yosys reads the Verilog and counts the cells of a family.

Only mapped cells are counted: nothing is placed or timed.
"""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from cosim import InputError
from cosim.errors import MissingPackages
from rtl_model.geometry import Geometry
from rtl_model.verilated import VERILOG

__all__ = ["VERILOG", "Cells", "Family", "synthesise"]

Family = Literal["ice40", "ecp5", "xc7"]

# Passes of yosys, and cells by kind: names begin with one of the prefixes. A CARRY4 holds four bits
# of a carry chain, a CCU2C two (and two LUTs), an SB_CARRY one; they are counted as cells.
SCRIPTS: dict[Family, str] = {
    "ice40": "synth_ice40",
    "ecp5": "synth_ecp5",
    "xc7": "synth_xilinx -family xc7 -flatten",
}
# yosys 0.23 remarks so on its own mapping of a memory to a RAMB36E1 or RAMB18E1, whose ports are
# in capitals; those of our source are not.
MAPPING = re.compile(
    r"Warning: Resizing cell port \S+\.\d+\.\d+\.[A-Z]+ from \d+ bits to \d+ bits\.$"
)
KINDS: dict[str, tuple[str, ...]] = {
    "luts": ("SB_LUT", "LUT"),
    "flip_flops": ("SB_DFF", "TRELLIS_FF", "FDRE", "FDSE", "FDCE", "FDPE"),
    "block_rams": ("SB_RAM", "DP16KD", "RAMB"),
    "large_block_rams": ("RAMB36",),
    "distributed_rams": ("TRELLIS_DPR16X4", "RAM16", "RAM32", "RAM64", "RAM128", "RAM256"),
    "carries": ("SB_CARRY", "CCU2C", "CARRY4"),
}


@dataclass(frozen=True)
class Cells:
    """Cells of one build in one family. Of the block RAMs, `large_block_rams` are twice as large as
    the others: an xc7's RAMB36, two of its RAMB18."""

    family: Family
    luts: int
    flip_flops: int
    block_rams: int
    distributed_rams: int
    carries: int
    large_block_rams: int = 0


def synthesise(
    family: Family,
    geometry: Geometry | None = None,
    *,
    top: str = "viform_board",
    settings: dict[str, int] | None = None,
    sources: Path = VERILOG,
    timeout_s: float = 900.0,
) -> Cells:
    """Returns the cells of module `top` in `family`. `settings` are its Verilog parameters; without
    them they are those of `geometry` (the 32 x 32 build). `sources` is the folder of its Verilog.

    Fails with InputError where yosys is missing, refuses the sources, or is not done in time.
    """
    yosys = shutil.which("yosys")
    if yosys is None:
        raise MissingPackages(
            "yosys", "be installed", "no such program", "apt-get install yosys", ["yosys"]
        )
    if settings is None:
        settings = (geometry or Geometry()).verilog
    chosen = "".join(f" -set {name} {value}" for name, value in settings.items())
    with tempfile.TemporaryDirectory() as folder:
        statistics = Path(folder) / "statistics.json"
        names = " ".join(path.name for path in sorted(sources.glob("*.v")))
        script = [f"read_verilog -I. {names}"]
        if chosen:
            script.append(f"chparam{chosen} {top}")
        script += [f"{SCRIPTS[family]} -top {top}", f"tee -q -o {statistics} stat -json"]
        try:
            done = subprocess.run(
                [yosys, "-q", "-p", "; ".join(script)],
                cwd=sources,
                capture_output=True,
                text=True,
                timeout=timeout_s,
                check=False,
            )
        except subprocess.TimeoutExpired as exc:
            raise InputError(
                "yosys", f"done within {timeout_s:g} s", f"still at work on {top}",
                "take a smaller geometry, or leave its cells uncounted",
            ) from exc  # fmt: skip
        said = done.stdout + done.stderr
        remarks = [line for line in said.splitlines() if line and not MAPPING.match(line)]
        if done.returncode or remarks:
            line = (remarks or ["an error without a word"])[0]
            raise InputError("the Verilog", "accepted by yosys", line, "see rtl_model/verilog")
        text = statistics.read_text(encoding="utf-8")
    # yosys 0.23 prints a line of its own before the document.
    found = json.loads(text[text.index("{") :])["design"]["num_cells_by_type"]
    counts = {
        kind: sum(count for name, count in found.items() if name.startswith(prefixes))
        for kind, prefixes in KINDS.items()
    }
    return Cells(family=family, **counts)
