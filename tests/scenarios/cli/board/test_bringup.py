"""`viform board` and `viform run bring-up` on the model-level virtual board."""

import json
import xml.etree.ElementTree as xml

import pytest

from cosim import InputError
from cosim.run.machine import Options
from rtl_model.bringup.bench.endpoint import virtual_board
from rtl_model.bringup.report.page import write_board_report
from rtl_model.bringup.run import bring_up
from scenarios.assemble.schema.loading import load
from scenarios.cli.output import SilentProgress
from scenarios.run import run_scenario


def run_board(name, scenario, out, trace=None):
    options, progress = Options(trace=trace), SilentProgress()
    done = run_scenario(name, scenario, out, options=options, progress=progress, began=0.0)
    return done.result, done.folder


SMALL = ["board.level=model", "board.rows=4", "board.columns=40", "board.frames=12"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("faults", "outcome"), [([], "ok"), (['board.faults=["stuck=2,33"]'], "failed")]
)
def test_a_run_brings_a_board_up(tmp_path, faults, outcome):
    name, scenario = load("bring-up", SMALL + faults)
    result, folder = run_board(name, scenario, tmp_path / "run")
    document = json.loads((folder / "result.json").read_text())
    assert result.outcome == document["outcome"] == outcome
    suite = xml.parse(folder / "junit.xml").getroot().find("testsuite")
    page = (folder / "report.html").read_text()
    assert "http" not in page.split("</style>")[1].replace("https://www.w3.org", "")
    if outcome == "ok":
        assert document["metrics"]["bits_wrong"]["value"] == 0
        assert document["metrics"]["frames_compared"]["value"] == 4 * 8 + 12
        assert document["metrics"]["round_trips_per_s"]["value"] > 0
        assert (folder / "stream.zarr").is_dir()
        assert suite.attrib["failures"] == "0"
    else:
        assert suite.attrib["failures"] == "1"
        assert "2, 33" in page


@pytest.mark.parametrize(
    ("assignments", "says"),
    [
        (["board.level=paper"], "board.level must be"),
        (["board.frames=0"], "board.frames must be at least 1"),
        (["scene.kind=step"], "absent in a scenario with a [scene]"),
        (["board.prot=x"], "did you mean board.port?"),
    ],
)
def test_a_wrong_key_is_refused_in_one_line(assignments, says):
    with pytest.raises(InputError) as caught:
        load("bring-up", assignments)
    assert says in str(caught.value) and "\n" not in str(caught.value)


def test_more_frames_than_memory_are_refused(tmp_path):
    name, scenario = load("bring-up", ["board.rows=1000", "board.columns=1000"])
    with pytest.raises(InputError, match=r"board\.frames must be at most"):
        run_board(
            name, scenario.model_copy(update={"board": scenario.board.model_copy(
                update={"frames": 60_000})}), tmp_path / "run",
        )  # fmt: skip
    assert not (tmp_path / "run").exists()


def test_waveforms_of_a_real_board_are_refused(tmp_path):
    name, scenario = load("bring-up", ["board.port=/dev/ttyUSB9"])
    with pytest.raises(InputError, match=r"--trace must be given with board\.port=virtual"):
        run_board(
            name, scenario, tmp_path / "run",
            trace=tmp_path / "x.fst",
        )  # fmt: skip


def test_the_report_of_a_silent_board_tells_the_cause(tmp_path):
    report = bring_up("/dev/there-is-none")
    assert write_board_report(report, tmp_path) == ["report.html", "junit.xml"]
    assert "Stage port failed" in (tmp_path / "report.html").read_text()


def test_a_level_that_is_none_is_refused():
    with pytest.raises(InputError, match="--level must be one of"):
        virtual_board(baud=115_200, level="paper")
