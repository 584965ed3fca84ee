"""The reports of all kinds of runs in a real browser."""

from __future__ import annotations

from pathlib import Path

import pytest

from cosim.report.explorer import kinds_in
from scenarios.cli.entry import _main
from tests.browser.driver import Browser
from tests.recorded.cases import CASES, EIGHT

WORDS = {case.name: case.words for case in CASES if case.name.startswith("run ")}
KINDS = {
    name: WORDS[name if name in WORDS else f"{name} default"]
    for name in (
        "run film", "run glass", "run silicon", "run wave", "run shockwave", "run star", "run step",
        "run sun-and-stars", "run asynchronous", "run continuous", "run light-link",
        "run adaptive-exposure", "run ebaps-night", "run emccd-window", "run glass-over-light",
        "run bring-up", "run boards",
    )
}  # fmt: skip
KINDS |= {f"run {name}": ("run", name) for name in ("hardware-chain", "playback")}
KINDS["run objects"] = ("run", "objects", *EIGHT)
FRAMES = ("adaptive-exposure", "ebaps-night", "emccd-window", "hardware-chain")
STREAMS = ("film", "silicon", "wave", "shockwave", "star", "step", "objects")
EXPLORERS = {
    **{f"run {name}": ["frames"] for name in (*FRAMES, "continuous")},
    **{f"run {name}": ["stream", "tiles"] for name in STREAMS},
    "run glass": ["beside", "tiles"], "run glass-over-light": ["beside", "tiles"],
    "run asynchronous": ["stream"], "run playback": ["beside", "stream"], "run boards": ["stream"],
    "run light-link": ["cells"], "run bring-up": [], "run sun-and-stars": [],
}  # fmt: skip
"""Kinds of the explorers of each page. A bring-up and steady discs over decades have none."""
OTHERS = [("compare", "step"), ("board", "bringup", "--level", "model"), ("calibrate",)]
STILL = """
title = "A grey sheet"
duration = "0.1 s"
tolerance = 0
[scene]
kind = "target"
contrast = 1e-9
illuminance = "100 lux"
[sensor]
width = 64
height = 48
threshold = "900 e"
"""
"""A scenario of constant uniform light, from which a camera is calibrated."""
LARGEST = 12_000_000
"""Bytes of a page."""
NARROW = 400
POINT = """
const waits = [];
for (const one of [...document.querySelectorAll(".explorer")].map((root) => root.explorer)) {
  const canvas = one.canvas ?? one.pictures?.spikes.canvas;
  if (!canvas) continue;
  const box = canvas.getBoundingClientRect();
  canvas.dispatchEvent(new MouseEvent("click", {
    clientX: box.left + arguments[0] * box.width, clientY: box.top + arguments[1] * box.height,
  }));
  waits.push(one.drawing);
}
return Promise.all(waits).then(() => null)
"""


@pytest.mark.slow
@pytest.mark.parametrize("name", KINDS)
def test_a_report_works_alone(name: str, browser: Browser, tmp_path: Path) -> None:
    if name == "run playback":
        assert _main([*WORDS["run step default"], "--out", str(tmp_path / "step")]) == 0
        given = [*KINDS[name], "--set", f"sensor.source=file:{tmp_path / 'step'}"]
    else:
        given = list(KINDS[name])
    assert _main([*given, "--out", str(tmp_path / "run")]) == 0
    _works_alone(tmp_path / "run" / "report.html", browser, EXPLORERS[name])


@pytest.mark.slow
@pytest.mark.parametrize("words", OTHERS, ids=" ".join)
def test_a_page_of_another_command_works_alone_and_opens_with_answers(
    words: tuple[str, ...], browser: Browser, tmp_path: Path
) -> None:
    given = list(words)
    if words == ("calibrate",):
        (tmp_path / "still.toml").write_text(STILL)
        words = ["run", str(tmp_path / "still.toml"), "--out", str(tmp_path / "still")]
        assert _main(words) == 0
        given.append(str(tmp_path / "still"))
    assert _main([*given, "--out", str(tmp_path / "made")]) == 0
    _works_alone(tmp_path / "made" / "report.html", browser, [])
    questions = browser.run("return [...document.querySelectorAll('dt')].map((q) => q.textContent)")
    assert questions[0].startswith("What was ")
    for start in ("How wrong", "How long it took", "What was left out"):
        assert any(question.startswith(start) for question in questions[1:6])
    figures = "figure:not(:has(.enlarge))"
    assert browser.run("return document.querySelectorAll(arguments[0]).length", figures) == 0


def _works_alone(page: Path, browser: Browser, explorers: list[str]) -> None:
    """Opens a page in the dark on a narrow screen; it needs nothing from outside. explorers: the
    kinds that it must have."""
    assert page.stat().st_size < LARGEST
    browser.media()
    browser.resize(1100, 900)
    browser.open(page)
    opened = browser.run(
        "const all = [...document.querySelectorAll('.explorer')].map((root) => root.explorer);"
        "return Promise.all(all.map((one) => one.opened)).then(() => all.length)"
    )
    assert kinds_in(page.read_text()) == explorers
    assert opened == len(explorers)
    assert browser.run(
        "return [...document.images].filter((image) => !image.alt && image.id !== 'large-picture')"
        ".length"
    ) == 0  # fmt: skip
    browser.media(prefers_color_scheme="dark")
    browser.resize(NARROW, 900)
    for x, y in ((0.5, 0.5), (0.3, 0.6)):  # what is pointed at is drawn on a narrow screen, too
        browser.run(POINT, x, y)
    assert browser.run("return document.documentElement.scrollWidth") <= NARROW
    assert browser.requests() == [page.resolve().as_uri()]
    assert browser.complaints() == []
