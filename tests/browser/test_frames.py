"""The explorer of an imager's frames in a real browser."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from cosim.report import frames
from cosim.report.frames import FrameColumn, frames_part
from cosim.report.page import write_page
from tests.browser.driver import Browser

EXPLORER = "const e = document.querySelector('.explorer').explorer;"
RNG = np.random.default_rng(3)
SHOTS = [RNG.integers(0, 4096, size, np.uint16) for size in ((12, 20), (12, 20), (8, 16), (12, 20))]
EXPOSURE, STATE, HELD = [1.0, 2.0, 2.0, 4.0], [0.5, 0.5, None, 0.25], [7, 7, 9, 9]


def page(folder: Path, shots: list[np.ndarray], times: int = 1) -> Path:
    columns = [
        FrameColumn("Frame", "exposure", "ms", EXPOSURE * times),
        FrameColumn("Frame", "least", "DN", [int(one.min()) for one in shots]),
        FrameColumn("Frame", "most", "DN", [int(one.max()) for one in shots]),
        FrameColumn("Controller", "gain_step", "", STATE * times),
        FrameColumn("Registers", "chip_gain", "", HELD * times),
    ]
    ready = [10.0 * n for n in range(len(shots))]
    numbers = [n + 100 for n in range(len(shots))]
    shapes = [(one.shape[0], one.shape[1]) for one in shots]
    part = frames_part(shapes, shots.__getitem__, 4095, numbers, ready, columns, {"chip_gain": "G"})
    write_page(folder, "Frames", "<h1>Frames</h1>", f"<h2>Frames</h2>{part}")
    return folder / "report.html"


@pytest.fixture
def opened(browser: Browser, tmp_path: Path) -> Browser:
    browser.resize(1100, 900)
    browser.media()
    browser.open(page(tmp_path, SHOTS))
    browser.run(f"{EXPLORER} return e.opened.then(() => null)")
    return browser


def test_a_pixel_has_the_values_of_the_frames(opened: Browser) -> None:
    got = opened.run(
        EXPLORER + "e.pixel = [17, 9]; e.draw(); return [e.told.textContent,"
        "[0, 1, 2, 3].map((n) => e.value(n, 17, 9)), [0, 1, 2, 3].map((n) => e.value(n, 3, 5))]"
    )
    assert got[1] == [int(SHOTS[0][9, 17]), int(SHOTS[1][9, 17]), None, int(SHOTS[3][9, 17])]
    assert got[2] == [int(one[5, 3]) for one in SHOTS]
    assert got[0].startswith(f"Pixel x 17, y 9: {SHOTS[0][9, 17]} DN in this frame; mean of the 3")
    assert opened.complaints() == []


def test_dark_frames_are_not_the_first_that_is_shown(browser: Browser, tmp_path: Path) -> None:
    dark, grey, white = (np.full((12, 20), level, np.uint16) for level in (40, 400, 1600))
    dark[3, 4] = 60
    browser.open(page(tmp_path, [dark, dark, grey, white]))
    browser.run(f"{EXPLORER} return e.opened.then(() => null)")
    assert browser.run(EXPLORER + "return [e.at, e.number.value]") == [3, "3"]


def test_the_picture_is_that_of_the_values(opened: Browser) -> None:
    pixels = opened.run(
        EXPLORER + "e.tone.value = 'linear'; e.levels.value = 'frame'; e.go(2);"
        "return Array.from(e.canvas.getContext('2d').getImageData(0, 0, 16, 8).data)"
    )
    shot = SHOTS[2].astype(float)
    want = 255 * (shot - shot.min()) / (shot.max() - shot.min())
    got = np.array(pixels).reshape(8, 16, 4)
    assert np.abs(got[..., 0] - want).max() <= 0.5 + 1e-6
    assert (got[..., 0] == got[..., 2]).all()


def test_keys_go_to_other_frames_and_pixels(opened: Browser) -> None:
    opened.run(EXPLORER + "e.pixel = [4, 5]; e.canvas.focus()")
    opened.press("\ue00f", "\ue00f", "Right")  # page down
    assert opened.run(EXPLORER + "return [e.at, e.pixel, e.number.value]") == [2, [5, 5], "2"]
    opened.press("End", "\ue00e")  # page up
    assert opened.run(EXPLORER + "return e.at") == 2
    opened.press("Home")
    rows = "return [...document.querySelectorAll('.facts tr')].map((row) => row.textContent)"
    assert opened.run(rows)[0] == "exposure1 ms"
    opened.run(EXPLORER + "e.go(2)")
    told = opened.run(rows)
    assert told[-1] == "chip gain9 was 7" and told[3] == "gain step– was 0.5"
    changed = opened.run("return document.querySelectorAll('.facts .changed').length")
    assert changed == 2


def test_plots_follow_the_width_of_the_page(opened: Browser) -> None:
    wide = EXPLORER + "return [e.other.width, Math.round(e.other.getBoundingClientRect().width)]"
    before = opened.run(wide)
    opened.resize(500, 900)
    after = opened.run(wide)
    assert before[0] == before[1] and after[0] == after[1] < before[0] / 2


def test_it_plays_to_the_end(opened: Browser) -> None:
    opened.run(EXPLORER + "e.speed.value = 1; e.canvas.focus()")
    opened.press("Space")
    assert opened.run(
        EXPLORER + "return new Promise((done) => setInterval(() => { if (!e.playing) done(e.at) }))"
    ) == 3  # fmt: skip
    assert opened.run(EXPLORER + "return e.play.textContent") == "Play"


def test_files_have_all_figures_and_the_values(opened: Browser) -> None:
    files = opened.run(
        EXPLORER
        + "const found = []; URL.createObjectURL = (blob) => { found.push(blob); return '#' };"
        "HTMLAnchorElement.prototype.click = () => {}; e.pixel = [3, 5]; e.draw(); e.saveFigures();"
        "e.savePixel(); return Promise.all(found.map((blob) => blob.text()))"
    )
    assert files[0].splitlines()[0] == "frame,exposure_ms,least_DN,most_DN,gain_step,chip_gain"
    assert files[0].splitlines()[3] == f"102,2,{SHOTS[2].min()},{SHOTS[2].max()},,9"
    assert files[1].splitlines()[1] == f"3,5,100,0,{SHOTS[0][5, 3]}"


def test_a_page_is_bounded_and_says_what_it_has(
    browser: Browser, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(frames, "FRAMES", 3)
    monkeypatch.setattr(frames, "VALUES", 3 * 60)
    monkeypatch.setattr(frames, "FIGURES", 4)
    shots = [RNG.integers(0, 4096, (12, 20), np.uint16) for _ in range(12)]
    browser.resize(400, 900)
    browser.open(page(tmp_path, shots, 3))
    got = browser.run(
        EXPLORER + "return e.opened.then(() => { e.pixel = [2, 4]; e.draw(); return ["
        "e.given.numbers, e.place(), [0, 1, 2].map((n) => e.value(n, 2, 4)),"
        "document.querySelector('.explorer .soft').textContent,"
        "document.documentElement.scrollWidth] })"
    )
    assert got[0] == [100, 104, 106, 107, 111]  # those with a picture, and others
    assert got[1] == [5, 9]
    assert got[2] == [int(shots[n][9, 5]) for n in (0, 6, 11)]
    assert got[3].startswith(
        "3 of the 12 frames, evenly spread, are in this page, with one pixel of"
    )
    assert got[4] <= 400
    assert browser.complaints() == []
