"""Random packets, most of them valid: Verilog and cycle model answer the same."""

import pytest

from rtl_model.verilated.build import missing
from tests.rtl_model.lockstep import packet_fuzz

pytestmark = pytest.mark.skipif(bool(missing()), reason=f"not installed: {', '.join(missing())}")


def check(packets, seed):
    reports = []
    outcome = packet_fuzz.fuzz(packets, seed=seed, progress=reports.append)
    assert outcome.failure == ""
    assert outcome.packets == packets == reports[-1]
    assert outcome.sent > 8 * packets
    assert outcome.answered > 8 * packets
    assert len(outcome.counters) == 9
    assert len(reports) == packets // 50


def test_the_verilog_and_the_bridge_answer_alike():
    check(5000, seed=1)


@pytest.mark.slow
def test_a_hundred_thousand_packets():
    check(100_000, seed=2)


def test_the_comparison_would_notice(monkeypatch):
    """With a bridge whose watchdog is a clock late, the comparison must fail and name the place."""
    real = packet_fuzz.Bridge

    def late_watchdog(**arguments):
        bridge = real(**arguments)
        bridge.watchdog_clocks += 1
        return bridge

    monkeypatch.setattr(packet_fuzz, "Bridge", late_watchdog)
    outcome = packet_fuzz.fuzz(2000, seed=1)
    assert outcome.packets < 2000
    assert "the Verilog answers" in outcome.failure
    assert f"packet {outcome.packets} of seed 1" in outcome.failure
