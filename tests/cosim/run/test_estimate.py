"""What a recording is said to take, against steps of a known time."""

from __future__ import annotations

from pathlib import Path

import pytest

from cosim.run import progress
from cosim.run.progress import EstimatedProgress, duration_text


class Notes:
    def __init__(self) -> None:
        self.notes: list[str] = []
        self.done: list[int] = []

    def start(self, what: str, total: int) -> None:
        self.total = total

    def advance(self, done: int) -> None:
        self.done.append(done)

    def note(self, text: str) -> None:
        self.notes.append(text)


def film(
    monkeypatch: pytest.MonkeyPatch, folder: Path, step_s: float, begin: int = 0, steps: int = 100
) -> Notes:
    """Steps of 10 with 1 MB each; the first takes five seconds longer."""
    now, notes = [100.0], Notes()
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    watched = EstimatedProgress(notes, folder)
    watched.start("filming", 10 * steps)
    watched.advance(begin)
    for n in range(begin // 10, steps):
        now[0] += step_s + (5.0 if n == begin // 10 else 0.0)
        (folder / f"{n}").write_bytes(bytes(1_000_000))
        watched.advance(10 * (n + 1))
    watched.note("end")
    assert notes.done[-1] == notes.total == 10 * steps
    return notes


def test_time_and_disk_of_a_long_recording(tmp_path, monkeypatch):
    notes = film(monkeypatch, tmp_path, 0.5)
    text = "filming: recording takes about 55 s and 100 MB of disk; images and report follow"
    assert notes.notes == [text, "end"]


def test_a_short_recording_says_nothing(tmp_path, monkeypatch):
    assert film(monkeypatch, tmp_path, 0.04).notes == ["end"]


def test_a_resumed_recording_counts_what_is_left(tmp_path, monkeypatch):
    for n in range(50):
        (tmp_path / f"{n}").write_bytes(bytes(1_000_000))
    notes = film(monkeypatch, tmp_path, 0.5, begin=500)
    text = "filming: recording takes about 30 s and 100 MB of disk; images and report follow"
    assert notes.notes == [text, "end"]


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0.2, "1 s"),
        (119, "119 s"),
        (150, "2.5 min"),
        (600, "10 min"),
        (9000, "2.5 h"),
        (36_000, "10 h"),
    ],
)
def test_times_are_short(seconds, text):
    assert duration_text(seconds) == text
