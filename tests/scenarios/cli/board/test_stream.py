"""`viform board stream`: Verilog and cycle model of a stream from the command line."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest

from rtl_model.verilated import VERILOG
from rtl_model.verilated.build import missing
from tests.scenarios.conftest import Answer

# The build of the lockstep tests, so that it is compiled once.
COMMAND = ["board", "stream", "lines", "--rows", "6", "--columns", "40", "--depth", "16"]
needs_verilator = pytest.mark.skipif(
    bool(missing()), reason=f"not installed: {', '.join(missing())}"
)


@needs_verilator
def test_equal_bits_are_exit_0(viform: Callable[..., Answer]) -> None:
    answer = viform(*COMMAND, "--clocks", "5000", "--json")
    assert answer.code == 0, answer.err
    document = json.loads(answer.out)
    assert (document["ok"], document["difference"], document["source"]) == (True, None, "lines")
    assert document["compared"] >= 5000
    assert document["beats"] > 100
    assert "no difference" in viform(*COMMAND, "--clocks", "5000").out


@needs_verilator
@pytest.mark.slow
def test_a_difference_is_named_and_exit_1(viform: Callable[..., Answer], tmp_path: Path) -> None:
    copy = shutil.copytree(VERILOG, tmp_path / "verilog")
    path = copy / "viform_stream.v"
    path.write_text(path.read_text().replace("lost_rows + 32'd1", "lost_rows + 32'd2"))
    answer = viform(*COMMAND, "--sources", copy)
    assert answer.code == 1
    assert "lost_rows is 2 in the Verilog, 1 in the model" in answer.out
    path.write_text("module")
    answer = viform(*COMMAND, "--sources", copy)
    assert answer.code == 2
    assert answer.err.count("\n") == 2  # what is compared, and the refusal


def test_what_the_verilog_does_not_support_is_one_line(refused: Callable[..., str]) -> None:
    wide = ["board", "stream", "lines", "--columns", "1000"]
    assert "at least 33, which holds a row, not 32; take 64" in refused(*wide, "--depth", "32")
    assert "--lanes must be 32 or 64" in refused(*wide, "--lanes", "48")
    external = ["board", "stream", "external", "--columns", "32"]
    assert "--pixels must be 1, 2, 4 or 8" in refused(*external, "--pixels", "3")
    for option in ("--pixels", "--latency"):
        assert "given with external, not with lines" in refused(*wide, option, "4")
