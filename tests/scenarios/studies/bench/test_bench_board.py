"""`viform bench board`: a board over UDP in a process of its own, beside sockets alone."""

import pytest

from rtl_model.bringup.stages.ethernet import Rates
from scenarios.studies.bench import board


def test_the_rows_are_payload_beside_that_of_sockets_alone(monkeypatch):
    monkeypatch.setattr(board, "SECONDS", 0.1)
    rows = board.board_rows(None, None)
    assert [row.name for row in rows] == ["board.read", "board.write"]
    for row in rows:
        assert row.unit == "bit/s" and row.value > 0 and row.plain_ratio is None
        assert row.realtime == pytest.approx(row.value / 100e6)
        assert row.ceiling_ratio > 0


def test_a_wrong_word_is_no_throughput(monkeypatch):
    monkeypatch.setattr(board, "measured_rates", lambda *_: Rates(1.0, 1.0, 1, 1, wrong=3))
    with pytest.raises(RuntimeError, match="3 packets with wrong words"):
        board.board_rows(None, None)
