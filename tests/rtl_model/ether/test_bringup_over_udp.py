"""The bring-up over UDP: all stages, losses by name, and faults by their cause."""

import shutil

import pytest

from rtl_model.bringup.bench.stage import UDP_STAGES
from rtl_model.bringup.report.page import write_board_report
from rtl_model.bringup.report.summary import stage_text
from rtl_model.bringup.run import BringUp, bring_up
from rtl_model.host.ether import udp_address
from rtl_model.virtual.ethernet import EthernetBoard
from tests.rtl_model.ether.conftest import SIZE
from tests.rtl_model.ether.lossy_proxy import LossyProxy


def outcomes(report):
    return {stage.name: stage.outcome for stage in report.stages}


def proxy_of(board, **shares):
    return LossyProxy(("127.0.0.1", udp_address(board.port).port), **shares)


def test_every_stage_passes_through_a_lossy_network_and_the_report_names_the_loss(
    board, tmp_path, monkeypatch
):
    # Shorter than for a user: two of sixteen threshold levels.
    monkeypatch.setattr("rtl_model.bringup.stages.ethernet._SECONDS", 0.05)
    monkeypatch.setattr("rtl_model.bringup.stages.threshold.LEVELS", 2)
    with proxy_of(board, seed=3, loss=0.01, repeat=0.01, reorder=0.01) as proxy:
        report = bring_up(proxy.url, BringUp(frames=4))
    assert report.ok, report.cause
    assert tuple(outcomes(report)) == UDP_STAGES
    assert report.figure("patterns", "bits_wrong") == 0
    assert report.figure("patterns", "bits_compared") == 4 * 4 * 4 * 40
    lost = report.figure("loss", "packets_lost")
    assert 0 < lost < 0.1 * report.figure("loss", "packets")
    loss = next(stage for stage in report.stages if stage.name == "loss")
    assert f"{lost} of 512 packets are lost" in stage_text(loss)
    assert report.figure("rate", "read_bits_per_s") > 0
    assert report.document()["baud"] is None
    write_board_report(report, tmp_path)
    page = (tmp_path / "report.html").read_text()
    assert f"{lost} of 512 packets are lost" in page and "packets lost" in page


@pytest.mark.slow
def test_more_loss_than_a_tenth_is_a_fault(board):
    with proxy_of(board, seed=3, loss=0.1, repeat=0, reorder=0) as proxy:
        report = bring_up(proxy.url)
    assert report.failed_stage == "loss" and report.failed.kind == "loss"
    assert "packets are lost" in report.cause and "check cable" in report.cause
    assert outcomes(report)["rate"] == "left out"


@pytest.mark.parametrize(
    ("faults", "stage", "kind", "says"),
    [
        (["foreign"], "identity", "foreign", "another design answers"),
        (["silent"], "link", "silent", "no answer from udp:127.0.0.1"),
        (["stuck=2,33"], "patterns", "wrong-bits", "row 2, column 33"),
    ],
)
def test_a_fault_is_named(faults, stage, kind, says, monkeypatch):
    monkeypatch.setattr("rtl_model.bringup.over_udp.patience_s", lambda *_: 0.1)
    monkeypatch.setattr("rtl_model.host.ether.etherbone._PROBE_WAIT_S", 0.02)
    with EthernetBoard("udp:127.0.0.1:0", SIZE, level="model", faults=faults) as board:
        report = bring_up(board.port, BringUp(frames=4))
    assert (report.failed_stage, report.failed.kind) == (stage, kind)
    assert says in report.cause


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("verilator") is None, reason="needs Verilator")
def test_the_verilog_passes_through_a_lossy_network():
    with EthernetBoard("udp:127.0.0.1:0", SIZE, level="bytes") as board, proxy_of(board) as proxy:
        report = bring_up(proxy.url, BringUp(frames=4, time_scale=board.time_scale))
    assert report.ok, report.cause
    assert report.figure("identity", "build_matches")
    assert report.figure("loss", "packets_lost") > 0
