"""`viform board` and `viform run bring-up` on the model-level virtual board."""

import json
import re
import xml.etree.ElementTree as xml

import pytest

from cosim import InputError
from cosim.run.machine import Options
from cosim.run.shown import SilentProgress
from rtl_model.bringup.bench.endpoint import virtual_board
from rtl_model.bringup.bench.stage import Report, Stage
from rtl_model.bringup.report.page import write_board_report
from rtl_model.bringup.run import bring_up
from scenarios.assemble.schema.loading import load
from scenarios.run import run_scenario
from tests.scenarios.pages import page_of


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
    page = (tmp_path / "report.html").read_text()
    assert "Stage port failed" in page and "before any bit was compared" in page


def test_the_report_states_the_error_rate_that_the_compared_bits_exclude(tmp_path):
    """None wrong of n: a rate p would show one with 95 % where (1 - p)^n = 0.05."""
    report = Report("port", 115_200, True)
    report.stages += [
        Stage("prbs", "ok", None, {"orders": [7], "bits": 3000, "bits_wrong": 0}, 2.0),
        Stage("patterns", "failed", "a bit", {"bits_compared": 64}, 1.0),
        Stage("timing", "left out", "stage patterns failed", {}, 0.0),
    ]
    write_board_report(report, tmp_path)
    page = page_of(tmp_path)
    rate = float(re.search(r"error rate is below ([\d.]+) with 95 %", page)[1])
    assert (1 - rate) ** 3000 == pytest.approx(0.05, rel=0.02)
    questions = re.findall(r"<dt>(What|How|Whether)[^<]*</dt>", page)
    assert questions == ["What", "Whether", "How", "How", "What"]
    assert "Stage timing, which depends on stage patterns" in page


def test_a_level_that_is_none_is_refused():
    with pytest.raises(InputError, match="--level must be one of"):
        virtual_board(baud=115_200, level="paper")
