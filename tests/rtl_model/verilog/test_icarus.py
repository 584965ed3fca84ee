"""The board in a second simulator, Icarus, over its pins."""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from rtl_model.verilated import VERILOG

BENCH = Path(__file__).with_name("testbench.v")
needs_icarus = pytest.mark.skipif(
    shutil.which("iverilog") is None, reason="needs the system package iverilog"
)


@pytest.fixture(scope="module")
def lines_printed(tmp_path_factory):
    """Lines that the test bench prints. A warning of the compiler fails."""
    program = tmp_path_factory.mktemp("icarus") / "bench.vvp"
    sources = [str(path) for path in sorted(VERILOG.glob("*.v"))]
    command = ["iverilog", "-g2005", "-Wall", "-Wno-timescale", "-I", str(VERILOG)]
    command += ["-s", "testbench", "-o", str(program), *sources, str(BENCH)]
    built = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)
    assert (built.returncode, built.stderr) == (0, "")
    run = subprocess.run(
        ["vvp", "-n", str(program)], capture_output=True, text=True, timeout=120, check=True
    )
    lines = run.stdout.splitlines()
    assert lines[-1] == "done"
    return lines


@needs_icarus
def test_magic_and_scratch_are_read_over_the_pins(lines_printed):
    sent = "".join(line.split()[1] for line in lines_printed if line.startswith("byte "))
    assert "framing" not in lines_printed
    assert sent == "53504b3212345678"


@needs_icarus
def test_a_row_of_pixels_fires_when_its_electrons_add_up(lines_printed):
    """After n ticks of e electrons a residual pixel has fired floor(n e / 255) times."""
    tiles = [line.split()[1:] for line in lines_printed if line.startswith("tile ")]
    assert {row for _, _, row, _, _ in tiles} == {"1"}
    frames = int(tiles[-1][1]) + 1
    assert frames >= 4
    assert [(int(f), int(t)) for _, f, _, t, _ in tiles] == [
        (frame, tile) for frame in range(frames) for tile in (0, 1)
    ]
    first = int(tiles[0][0])
    assert [int(clock) - first for clock, *_ in tiles] == [
        100 * frame + tile for frame in range(frames) for tile in (0, 1)
    ]
    words = np.array([int(bits, 16) for *_, bits in tiles], np.uint64)
    planes = (words[:, None] >> np.arange(32, dtype=np.uint64) & np.uint64(1)).reshape(frames, 64)
    # 8 c electrons at column c, modulo 256; columns from 40 on are pads.
    electrons = np.where(np.arange(64) < 40, 8 * np.arange(64) % 256, 0)
    total = np.arange(1, frames + 1)[:, None] * electrons
    assert np.array_equal(planes.cumsum(axis=0), total // 255)
    assert planes.sum() > 0
