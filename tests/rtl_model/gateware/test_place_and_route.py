"""Builds the bitstream of a generated folder, with tools that the environment names.

VIFORM_NEXTPNR_ECP5 names nextpnr-ecp5 (YoWASP's will do), VIFORM_ECPPACK ecppack where that is not
called so. The tools are no dependency of the project: without the variable this says so and skips.
"""

import json
import os
import shutil
import subprocess

import pytest

from rtl_model.gateware import design_for, target_named, write_folder


@pytest.fixture
def tools():
    """Variables of the Makefile."""
    nextpnr = os.environ.get("VIFORM_NEXTPNR_ECP5")
    if not nextpnr:
        pytest.skip("VIFORM_NEXTPNR_ECP5 names no nextpnr-ecp5")
    ecppack = os.environ.get("VIFORM_ECPPACK", "ecppack")
    for program in (nextpnr, ecppack, "yosys", "make"):
        if shutil.which(program) is None:
            pytest.skip(
                f"{program} is no program: name it in VIFORM_NEXTPNR_ECP5 or VIFORM_ECPPACK"
            )
    return [f"NEXTPNR={nextpnr}", f"ECPPACK={ecppack}"]


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["ulx3s-12f", "ulx3s-25f", "colorlight-i5", "orangecrab-25f", "ulx3s-45f", "ulx3s-85f"]
)
def test_make_ends_in_a_bitstream_that_keeps_time(name, tools, tmp_path):
    target = target_named(name)
    write_folder(design_for(target), tmp_path / name)
    subprocess.run(["make", "-C", tmp_path / name, *tools], check=True, timeout=3000)
    bitstream = (tmp_path / name / "viform.bit").read_bytes()
    assert len(bitstream) > 100_000
    report = json.loads((tmp_path / name / "nextpnr.json").read_text())
    closed = [clock for clock in report["fmax"].values() if clock["achieved"] < 1000]
    assert max(clock["constraint"] for clock in closed) >= target.clock_hz / 1e6
    assert all(clock["achieved"] >= clock["constraint"] for clock in closed), report["fmax"]
    used = report["utilization"]
    print(name, report["fmax"], {kind: used[kind] for kind in ("TRELLIS_COMB", "DP16KD")})
    assert used["DP16KD"]["used"] <= target.device.block_rams
    assert used["TRELLIS_COMB"]["used"] <= target.device.luts
