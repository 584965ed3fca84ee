"""Baud of a board: the true deviation lies within the reported uncertainty."""

from __future__ import annotations

import pytest

from rtl_model.cycle.system import LineCounters
from rtl_model.geometry import Geometry
from rtl_model.host import Cause, LineFault, find_baud, open_port
from rtl_model.virtual import VirtualBoard
from tests.rtl_model.bringup.model_port import ModelPort
from tests.rtl_model.virtual.hosts import needs_verilator


class Counted(ModelPort):
    """Counts the packets that it receives."""

    sent = 0

    def write(self, data: bytes, deadline_s: float = 1.0) -> None:
        self.sent += 1
        super().write(data, deadline_s)


@pytest.mark.parametrize("bit_clocks", [4, 5, 8, 32, 417])
@pytest.mark.parametrize("percent", [-12, -6, -4, -3, -1, 0, 2, 4, 6, 12])
def test_the_true_deviation_is_within_the_uncertainty(percent, bit_clocks):
    size = Geometry(rows=4, columns=40, clock_hz=50_000 * bit_clocks, baud=50_000)
    port = Counted(size, baud_error=percent / 100)
    report = find_baud(port, 50_000)
    assert report.tolerable == (abs(percent) <= 4)
    assert abs(report.error_percent - percent) <= report.uncertainty_percent
    assert report.uncertainty_percent < {4: 2.0, 5: 1.5, 8: 1.0}.get(bit_clocks, 0.3)
    assert report.by_pulse and report.bit_clocks == bit_clocks
    assert report.baud == (50_000 if report.tolerable else report.measured)
    assert port.sent < 70


@pytest.mark.parametrize("host", [9_600, 38_400, 57_600, 76_800, 170_000, 230_400, 921_600])
@pytest.mark.parametrize("percent", [-3, 0, 1])
def test_a_host_at_another_standard_rate_finds_the_board(monkeypatch, host, percent):
    written = []
    monkeypatch.setattr(LineCounters, "count_write", lambda _, value: written.append(value))
    port = Counted(Geometry(rows=4, columns=40), baud=host, baud_error=percent / 100)
    assert port.geometry.baud == 115_200
    report = find_baud(port, host)
    assert not report.tolerable and report.baud == report.measured
    true = 115_200 * (1 + percent / 100)
    assert abs(report.measured - true) <= report.uncertainty_percent / 100 * host < 0.01 * true
    assert written == [1]  # to `uart_clear`


def test_a_silent_board_is_tried_at_every_rate():
    port = Counted(Geometry(rows=4, columns=40), baud=7_000, baud_error=1.2)
    with pytest.raises(LineFault, match="within 20 % of 7000 baud or at a standard rate") as caught:
        find_baud(port, 7_000)
    assert caught.value.cause is Cause.SILENT and port.baud == 7_000 and port.sent < 40


@needs_verilator
@pytest.mark.slow
@pytest.mark.parametrize("bit_clocks", [4, 7, 32])
@pytest.mark.parametrize("fault", [-12, -8, -5, -4, -2, 1, 3, 4, 5, 8, 12])
def test_on_pins_too(fault, bit_clocks):
    """The host's rate is wrong, so by its clock the board's is off by the inverse."""
    size = Geometry(
        rows=8, columns=40, clock_hz=62_500 * bit_clocks, baud=62_500, capture_words=256
    )
    with VirtualBoard(size, level="pins", faults=[f"baud={fault}"]) as board:
        port = open_port(board.port, 62_500)
        report = find_baud(port, 62_500, time_scale=board.time_scale)
        port.close()
    true = 100 * (1 / (1 + fault / 100) - 1)
    assert abs(report.error_percent - true) <= report.uncertainty_percent < 1.0
