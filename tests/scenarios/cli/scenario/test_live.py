"""viform live on a window of our own, and each way in which there is none."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable

import numpy as np
import numpy.typing as npt
import pytest

from cosim import InputError
from cosim.run.shown import SilentProgress
from display import open_window
from scenarios.assemble.schema.loading import load
from scenarios.cli.scenario.live import FRAME, show_live

SMALL = [
    "sensor.chip=spikeone", "sensor.clock=40 kHz", "duration=20 ms", "display.renderer=numpy",
    "display.width=80", "display.height=50", "display.fit=nearest",
]  # fmt: skip


class Screen:
    """Keeps what it is shown; is closed by its user after `most` pictures."""

    context = None

    def __init__(self, most: int = 1000) -> None:
        self.pictures: list[npt.NDArray[np.uint8]] = []
        self.most, self.closed = most, False

    def show(self, picture: npt.NDArray[np.uint8]) -> bool:
        self.pictures.append(picture)
        return len(self.pictures) <= self.most

    def close(self) -> None:
        self.closed = True


def test_a_run_is_shown_as_it_goes_on_and_ends_where_the_window_is_closed() -> None:
    _, scenario = load("step", [*SMALL, "scene.at=6.4 ms"])
    screen = Screen()
    shown = show_live(scenario, None, SilentProgress(), lambda title, shape: screen)
    assert shown == len(screen.pictures) == -(-800 // FRAME)
    assert screen.closed and screen.pictures[0].shape == (50, 80)
    assert screen.pictures[0].dtype == np.uint8
    before, after = screen.pictures[0].astype(float), screen.pictures[-1].astype(float)
    assert np.abs(after - before).max() > 20  # the bars have jumped
    short = Screen(1)
    assert show_live(scenario, None, SilentProgress(), lambda title, shape: short) == 1
    assert short.closed


def test_a_chip_that_says_more_than_its_spikes_is_refused(refused):
    line = refused("live", "step", "--set", 'sensor.writes=[{"cycle":9,"threshold_level":8}]')
    assert "sensor.writes must be empty with viform live" in line and "one size alone" in line


def test_without_the_package_one_line_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, refused: Callable[..., str]
) -> None:
    monkeypatch.setitem(sys.modules, "moderngl_window", None)
    line = refused("live", "step", *(part for key in SMALL for part in ("--set", key)))
    assert "moderngl-window is installed, not without it; pip install" in line


def test_without_a_screen_one_line_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    if importlib.util.find_spec("moderngl_window") is None:
        pytest.skip("needs moderngl-window (the extra view)")
    monkeypatch.delenv("DISPLAY", raising=False)
    with pytest.raises(InputError, match="run where a window can be opened"):
        open_window("none", (10, 10))


def test_pixels_without_a_latch_clock_are_refused(refused: Callable[..., str]) -> None:
    line = refused("live", "sun-and-stars", "--set", "sensor.pixel=asynchronous")
    assert line.startswith("sensor.pixel must be latched for viform live")
