"""Resource use of a build in an FPGA: yosys maps the Verilog to the cells of a family.

The mapped cells are counted. Placement and timing are not computed.
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

Family = Literal["ice40", "ecp5", "xc7"]

# Passes of yosys for each family.
SCRIPTS: dict[Family, str] = {
    "ice40": "synth_ice40",
    "ecp5": "synth_ecp5",
    "xc7": "synth_xilinx -family xc7 -flatten",
}
# Warning of yosys 0.23 about its own mapping of a memory to a RAMB36E1 or RAMB18E1. These have port
# names in capitals, unlike the sources of this project.
MAPPING = re.compile(
    r"Warning: Resizing cell port \S+\.\d+\.\d+\.[A-Z]+ from \d+ bits to \d+ bits\.$"
)
# Prefixes of the cells' names by kind. A CARRY4 holds four bits of a carry chain, a CCU2C two (and
# two LUTs), an SB_CARRY one. All are counted as cells.
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
    """Cells of one build.

    Attributes:
        family: family of the FPGA.
        luts, flip_flops, distributed_rams, carries: numbers of cells.
        block_rams: number of block RAMs of all sizes.
        large_block_rams: block RAMs of double size among these: an xc7's RAMB36.
    """

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
    """Counts the cells of a module.

    Args:
        family: family of the FPGA.
        geometry: geometry of the build; the 32 x 32 build if None.
        top: name of the module.
        settings: its Verilog parameters; those of `geometry` if None.
        sources: folder of the Verilog.
        timeout_s: time limit of yosys, s.

    Raises:
        InputError: if yosys is missing, rejects the sources, or exceeds the time limit.
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
        # yosys takes a blank in a name for its end, so names are relative to its working folder.
        (Path(folder) / "sources").symlink_to(sources.resolve())
        names = " ".join(f"sources/{path.name}" for path in sorted(sources.glob("*.v")))
        script = [f"read_verilog -Isources {names}"]
        if chosen:
            script.append(f"chparam{chosen} {top}")
        script += [f"{SCRIPTS[family]} -top {top}", "tee -q -o statistics.json stat -json"]
        try:
            done = subprocess.run(
                [yosys, "-q", "-p", "; ".join(script)],
                cwd=folder,
                capture_output=True,
                encoding="utf-8",
                errors="replace",
                timeout=timeout_s,
                check=False,
            )
        except subprocess.TimeoutExpired as exc:
            raise InputError(
                "yosys", f"done within {timeout_s:g} s", f"still running on {top}",
                "take a smaller geometry, or leave its cells uncounted",
            ) from exc  # fmt: skip
        output = done.stdout + done.stderr
        remarks = [line for line in output.splitlines() if line and not MAPPING.match(line)]
        if done.returncode or remarks:
            line = (remarks or ["an error without a message"])[0]
            raise InputError("the Verilog", "accepted by yosys", line, "see rtl_model/verilog")
        text = (Path(folder) / "statistics.json").read_text(encoding="utf-8")
    # yosys 0.23 prints a line before the document.
    cells = json.loads(text[text.index("{") :])["design"]["num_cells_by_type"]
    counts = {
        kind: sum(count for name, count in cells.items() if name.startswith(prefixes))
        for kind, prefixes in KINDS.items()
    }
    return Cells(family=family, **counts)
