"""What a log shows of a long run."""

from __future__ import annotations

import pytest

from scenarios.cli.output import LineProgress, TerminalProgress, make_progress


class Hand:
    """A clock that is moved by hand."""

    def __init__(self) -> None:
        self.now = 100.0

    def monotonic(self) -> float:
        return self.now


@pytest.fixture
def hand(monkeypatch: pytest.MonkeyPatch) -> Hand:
    made = Hand()
    monkeypatch.setattr("cosim.run.shown.time", made)
    return made


def test_a_log_gets_a_line_every_ten_seconds(hand, capsys):
    progress = make_progress()
    assert isinstance(progress, LineProgress)
    progress.start("film", 200)
    for done in range(0, 201, 10):  # 10 cycles in 3 s
        progress.advance(done)
        hand.now += 3
    progress.close()
    out, err = capsys.readouterr()
    assert out == ""
    assert err.splitlines() == [
        "viform: film: 20 %, 48 s left",
        "viform: film: 40 %, 36 s left",
        "viform: film: 60 %, 24 s left",
        "viform: film: 80 %, 12 s left",
        "viform: film: 100 %",
    ]


def test_a_short_run_says_nothing_and_so_does_none(hand, capsys):
    progress = LineProgress()
    progress.start("film", 2)
    for done in (0, 1, 2):
        progress.advance(done)
        hand.now += 4
    hand.now += 100
    progress.start("nothing to do", 0)
    progress.advance(0)
    assert capsys.readouterr() == ("", "")


def test_a_run_that_is_gone_on_with_counts_from_where_it_was(hand, capsys):
    progress = LineProgress()
    progress.start("film", 1000)
    progress.advance(900)
    hand.now += 5  # the first step compiles kernels, and does not count
    progress.advance(910)
    hand.now += 20
    progress.advance(930)
    assert capsys.readouterr().err == "viform: film: 93 %, 70 s left\n"


@pytest.mark.parametrize(
    ("seconds", "said"),
    [
        (0.2, "1 s"),
        (119, "119 s"),
        (150, "2.5 min"),
        (600, "10 min"),
        (6600, "110 min"),
        (9000, "2.5 h"),
        (450_000, "125 h"),
    ],
)
def test_a_time_is_said_in_the_unit_that_suits_it(hand, capsys, seconds, said):
    progress = LineProgress()
    progress.start("film", 3)
    hand.now += 20
    progress.advance(0)
    progress.advance(1)
    hand.now += seconds if seconds >= 10 else 10
    progress._first = (1, hand.now - seconds)
    progress.advance(2)
    assert capsys.readouterr().err.splitlines()[-1] == f"viform: film: 66 %, {said} left"


def test_a_terminal_has_its_bar(monkeypatch):
    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)
    progress = make_progress()
    progress.close()
    assert isinstance(progress, TerminalProgress)


def test_a_run_of_unknown_length_says_what_it_has_been_told(hand, capsys):
    progress = LineProgress()
    progress.start("a: 0 planes", 0)
    for done in (0, 64, 128):
        progress.tell(f"a: {done} planes")
        progress.advance(done)
        hand.now += 11
    assert capsys.readouterr().err == "viform: a: 64 planes\nviform: a: 128 planes\n"
