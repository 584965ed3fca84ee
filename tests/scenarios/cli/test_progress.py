"""What a log shows of a long run."""

from __future__ import annotations

import threading

import pytest

from cosim.compute.compiling import compiles
from cosim.run.shown import LineProgress, TerminalProgress, make_progress


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
    monkeypatch.setattr("cosim.compute.compiling.time", made)
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
    hand.now += 5  # the first steps compile kernels, and do not count
    progress.advance(910)
    hand.now += 4
    progress.advance(920)
    hand.now += 10
    progress.advance(930)
    assert capsys.readouterr().err == "viform: film: 93 %, 70 s left\n"


def test_steps_that_start_up_are_in_no_estimate(hand, capsys):
    """Two slow steps of 8 and 3 s, then 98 of 0.3 s."""
    progress = LineProgress()
    progress.start("film", 100)
    progress.advance(0)
    for done in range(1, 101):
        hand.now += {1: 8, 2: 3}.get(done, 0.3)
        progress.advance(done)
    assert capsys.readouterr().err.splitlines() == [
        "viform: film: 2 %",
        "viform: film: 36 %, 19 s left",
        "viform: film: 70 %, 9 s left",
    ]


def test_a_long_step_says_every_ten_seconds_that_it_goes_on(hand, capsys):
    progress = LineProgress()
    progress.close()  # its thread: the clock is moved by hand
    with compiles():
        for seconds in (9, 1, 9):
            hand.now += seconds
            progress.remind()
    progress.start("film", 200)
    for seconds in (1, 10):
        hand.now += seconds
        progress.remind()
    progress.advance(10)
    hand.now += 10
    progress.remind()
    progress.note("a clip is short")
    hand.now += 9
    progress.remind()
    progress.advance(200)
    hand.now += 10
    progress.remind()
    assert capsys.readouterr().err.splitlines() == [
        "viform: preparing for 10 s; a first run compiles",
        "viform: film: 0 %, this step for 1 s; a first run compiles",
        "viform: film: 0 %, this step for 11 s",
        "viform: film: 5 %, this step for 10 s",
        "viform: a clip is short",
        "viform: film: done, what follows takes 10 s so far",
    ]


def test_the_reminders_come_by_themselves_and_end_with_the_progress(monkeypatch, capsys):
    monkeypatch.setattr("cosim.run.shown.EVERY_S", 0.0)
    before = set(threading.enumerate())
    progress = LineProgress()
    progress.start("film", 200)
    (thread,) = set(threading.enumerate()) - before
    thread.join(1.5)
    progress.close()
    thread.join(10)
    assert not thread.is_alive()
    assert "viform: film: 0 %, this step for" in capsys.readouterr().err


def test_a_terminal_has_its_bar(monkeypatch):
    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)
    progress = make_progress()
    progress.start("film", 2)
    progress.advance(1)
    progress.close()
    assert isinstance(progress, TerminalProgress)


def test_a_terminal_shows_preparing_until_the_first_stage(monkeypatch, capsys):
    monkeypatch.setattr("sys.stderr.isatty", lambda: True, raising=False)
    progress = TerminalProgress()
    shown = progress._progress
    assert [task.description for task in shown.tasks] == ["preparing"]
    progress.start("film", 2)
    assert [task.description for task in shown.tasks] == ["film"]
    progress.close()
    assert "0:00:00" in capsys.readouterr().err


def test_a_run_of_unknown_length_says_what_it_has_been_told(hand, capsys):
    progress = LineProgress()
    progress.start("a: 0 planes", 0)
    for done in (0, 64, 128):
        progress.tell(f"a: {done} planes")
        progress.advance(done)
        hand.now += 11
    assert capsys.readouterr().err == "viform: a: 64 planes\nviform: a: 128 planes\n"
