"""The explorers of a page in a real browser: what they compute, and what mouse and keyboard do."""

from __future__ import annotations

import threading
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from cosim import Clock, Viform
from cosim.report.beside import beside
from cosim.report.explorer import Truths, explorer, explorer_part, packed
from cosim.report.page import write_page
from cosim.report.png import to_linear_bytes
from cosim.spikes.viform import pack_planes
from scenarios.view.opened import Opened
from scenarios.view.server import ViewServer
from sensor import isi, tau_levels
from sensor.reconstruct import reconstruct
from tests.browser.driver import Browser

CYCLES, SHAPE, WHITE = 300, (30, 40), 0.6
EXPLORER = "const e = document.querySelector('.explorer').explorer;"


def stream() -> Viform:
    """Pixels of rates from 0 to .7, some without a spike, some with one."""
    rates = np.linspace(0, 0.7, SHAPE[0] * SHAPE[1]).reshape(SHAPE)
    planes = np.random.default_rng(2).random((CYCLES, *SHAPE)) < rates
    planes[:, 0] = False
    planes[150, 0, :5] = True
    return Viform(pack_planes(planes), CYCLES, Clock(40_000))


SPIKES = stream()


def picture(method: str, at: int, window: int) -> np.ndarray:
    """The 8-bit picture of `viform image`."""
    if method == "tau":
        return tau_levels(isi(SPIKES, at))
    given = window if method == "tfp" else None
    return to_linear_bytes(reconstruct(SPIKES, method, at, given).rate, WHITE)


@pytest.fixture(scope="module")
def page(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("explorer")
    cycles = [0, 150, 299]
    light = [np.full(SHAPE, level, np.float32) for level in (0.2, 0.4, 0.8)]
    part = explorer_part(SPIKES, 150, WHITE, 41, Truths(cycles, light))
    write_page(folder, "A stream", "<h1>A stream</h1>", f"<h2>Explore</h2>{part}")
    return folder / "report.html"


@pytest.fixture
def opened(browser: Browser, page: Path) -> Browser:
    browser.resize(1100, 900)
    browser.media()
    browser.open(page)
    browser.run(f"{EXPLORER} return e.opened.then(() => null)")
    return browser


def codes(browser: Browser, method: str, at: int, window: int) -> np.ndarray:
    """The levels that the explorer shows after its controls were set."""
    got = browser.run(
        EXPLORER + "e.method.value = arguments[0]; e.at = arguments[1];"
        "e.window.value = arguments[2]; return e.draw().then(() => Array.from(e.codes))",
        method, at, window,
    )  # fmt: skip
    return np.array(got, np.uint8).reshape(SHAPE)


@pytest.mark.parametrize(
    ("method", "window"), [("tfp", 1), ("tfp", 41), ("tfp", 201), ("tfi", 41), ("tau", 41)]
)
def test_pictures_are_those_of_viform_image(opened: Browser, method: str, window: int) -> None:
    for at in (0, 151, CYCLES - 1):
        assert (codes(opened, method, at, window) == picture(method, at, window)).all()


def test_a_window_beyond_the_widest_is_the_widest(opened: Browser) -> None:
    codes(opened, "tfp", 150, 5000)
    assert opened.run(EXPLORER + "return [e.window.value, e.window.max]") == ["1001", "1001"]


def test_nothing_is_asked_for_and_no_error(opened: Browser, page: Path) -> None:
    assert opened.requests() == [page.resolve().as_uri()]
    assert opened.complaints() == []


def test_scrub_play_and_cycle(opened: Browser) -> None:
    opened.run(EXPLORER + "e.scrub.value = 222; e.scrub.dispatchEvent(new Event('input'))")
    assert opened.run(EXPLORER + "return [e.at, e.number.value, e.time.textContent]") == [
        222, "222", "5.563 ms",
    ]  # fmt: skip
    opened.run(EXPLORER + "e.speed.value = 8; e.play.click()")
    later = opened.run(
        EXPLORER + "return new Promise((done) => setInterval(() => { if (!e.playing) done(e.at) }))"
    )
    assert later == CYCLES - 1 and opened.run(EXPLORER + "return e.play.textContent") == "Play"


def test_a_pixel_by_mouse_and_keyboard(opened: Browser) -> None:
    x, y = 25, 17
    opened.run(
        EXPLORER + "const c = e.pictures.spikes.canvas, b = c.getBoundingClientRect();"
        "c.dispatchEvent(new MouseEvent('click', {clientX: b.left + (arguments[0] + .5) / 40"
        " * b.width, clientY: b.top + (arguments[1] + .5) / 30 * b.height})); c.focus();",
        x, y,
    )  # fmt: skip
    opened.press("Right")
    listed = opened.run(
        EXPLORER + "return e.draw().then(() => [e.listed, e.facts.textContent, e.range()])"
    )
    spikes = np.flatnonzero(SPIKES.planes()[:, y, x + 1])
    assert listed[0] == {"x": x + 1, "y": y, "spikes": spikes.tolist()}
    assert listed[1].startswith(f"Pixel x {x + 1}, y {y}: {len(spikes)} spikes in {CYCLES} cycles")
    assert listed[2] == [0, CYCLES]


def test_spikes_are_saved_as_csv(opened: Browser) -> None:
    text = opened.run(
        EXPLORER + "let kept = null; const make = URL.createObjectURL;"
        "URL.createObjectURL = (blob) => { kept = blob; return make(blob) };"
        "return e.pick(9, 20).then(() => { e.table.click(); return kept.text() })"
    )
    head, *rows = text.split()
    assert head == "x,y,cycle,latched_s"
    cycles = np.flatnonzero(SPIKES.planes()[:, 20, 9])
    assert [row.split(",")[:3] for row in rows] == [["9", "20", str(c)] for c in cycles]
    assert float(rows[0].split(",")[3]) == pytest.approx((cycles[0] + 1) / 40_000)


def test_true_light_and_difference(opened: Browser) -> None:
    light = opened.run(EXPLORER + "return e.source.light(75).then((v) => v[0])")
    assert light == round(255 * 0.3)  # half way from .2 to .4
    course = opened.run(EXPLORER + "return e.source.course(3, 3, [0, 150, 299])")
    assert course == pytest.approx([0.2, 0.4, 0.8], abs=1 / 255)


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_narrow_and_dark(opened: Browser, scheme: str) -> None:
    opened.resize(400, 900)
    opened.media(prefers_color_scheme=scheme)
    opened.run(EXPLORER + "return e.pick(5, 5).then(() => null)")
    wide = opened.run("return document.documentElement.scrollWidth")
    assert wide <= 400
    ink, ground = opened.run(
        "const s = getComputedStyle(document.querySelector('.raster'));"
        "return [s.color, getComputedStyle(document.body).backgroundColor]"
    )
    assert ink != ground


def test_view_shows_the_same_pictures(browser: Browser) -> None:
    class Scene:
        def truth(self, ps: int) -> np.ndarray:
            return np.full(SHAPE, 0.5, np.float32)

    given = Opened("A view", SPIKES, WHITE, 41, Scene(), [])  # type: ignore[arg-type]
    with ViewServer() as server:
        server.opened = given
        thread = threading.Thread(target=server.serve_forever, args=(0.01,))
        thread.start()
        try:
            browser.go(server.address)
            browser.run(f"{EXPLORER} return e.opened.then(() => null)")
            for method in ("tfp", "tfi", "tau"):
                assert (codes(browser, method, 151, 41) == picture(method, 151, 41)).all()
            spikes = browser.run(EXPLORER + "return e.pick(9, 20).then(() => e.listed.spikes)")
            assert spikes == np.flatnonzero(SPIKES.planes()[:, 20, 9]).tolist()
            assert browser.complaints() == []
        finally:
            server.shutdown()
            thread.join()


def write(folder: Path, part: str) -> Path:
    write_page(folder, "A page", "<h1>A page</h1>", f"<h2>Explore</h2>{part}")
    return folder / "report.html"


def test_two_pictures_beside_each_other(browser: Browser, tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    shots: list[list[np.ndarray]] = [
        [rng.integers(0, 256, (12, 20), np.uint8) for _ in range(2)] for _ in range(3)
    ]
    browser.open(write(tmp_path, beside(["a", "b", "c"], "eye", {"still": shots}, ["1", "2"])))
    got = browser.run(
        EXPLORER + "e.left.value = 2; e.right.value = 0; e.instant.value = 0;"
        "return e.opened.then(() => e.draw()).then(() => e.canvases.map(([c]) => Array.from("
        "c.getContext('2d').getImageData(0, 0, c.width, c.height).data)))"
    )
    left, right, off = (np.array(one).reshape(12, 20, 4) for one in got)
    assert (left[..., 0] == shots[2][0]).all() and (right[..., 0] == shots[0][0]).all()
    brighter = shots[0][0].astype(int) > shots[2][0]
    assert (off[brighter, 0] >= off[brighter, 2]).all()
    assert browser.complaints() == []


def test_one_picture_stands_alone(browser: Browser, tmp_path: Path) -> None:
    shots = [[np.zeros((12, 20), np.uint8), np.ones((12, 20), np.uint8)]]
    browser.open(write(tmp_path, beside(["a"], "eye", {"still": shots}, ["1", "2"])))
    seen = browser.run(
        EXPLORER + "return e.opened.then(() => [...document.querySelectorAll('select, canvas')]"
        ".map((one) => one.checkVisibility()))"
    )
    assert seen == [False, False, True, True, True, False, False]
    assert browser.complaints() == []


def cells() -> dict[str, Any]:
    wrong = np.zeros((4, 6), np.int32)
    wrong[1, 2], wrong[3, 5], wrong[0] = 2, 1, -1
    places = np.array([[60, 8], [70, 8], [61, 23]], np.int32)
    return {
        "rows": 4, "columns": 6, "symbols": 40, "first": 48, "stop": 88, "top": 20.0,
        "whole": True, "side": 2, "homography": [1, 0, 10, 0, 1, 20, 0, 0, 1],
        "sure": packed(np.full((4, 6), 51, np.uint8)), "wrong": packed(wrong),
        "places": packed(places),
    }  # fmt: skip


def test_the_cells_of_a_link(browser: Browser, tmp_path: Path) -> None:
    browser.open(write(tmp_path, explorer(cells(), "cells")))
    facts = browser.run(
        EXPLORER + "return e.opened.then(() => { e.to.value = 65; e.cell = [2, 1]; e.draw();"
        "return e.facts.textContent })"
    )
    assert facts == (
        "Cell in row 1, column 2; wrong in 2 of 40 symbols, 1 of them in those shown; "
        "mean |soft value| 4.0 nats; its image is around camera pixel x 14.5, y 22.5."
    )
    pixels = browser.run(
        EXPLORER + "const c = e.canvas.getContext('2d');"
        "e.cell = null; e.draw(); return Array.from(c.getImageData(0, 0, 6, 4).data)"
    )
    red = np.array(pixels).reshape(4, 6, 4)[..., 0] == 255
    assert np.argwhere(red).tolist() == [[1, 2], [3, 5]]
    assert browser.complaints() == []


def test_the_soft_values_and_the_eye_of_a_cell(browser: Browser, tmp_path: Path) -> None:
    """Symbols 60, 61 and 63 of cells 8 and 20; cell 8 is wrong in symbol 61."""
    soft = np.array([[127, 64, -64], [-127, 127, -127]], np.int8)
    bits = np.array([[0, 1, 0, 1, 0, 1], [1, 0, 1, 1, 0, 0]], np.bool_)  # of symbols 59 to 64
    given = cells() | {
        "watched": {
            "cells": packed(np.array([8, 20], np.int32)),
            "top": 20.0,
            "period": 2.25,
            "symbols": packed(np.array([60, 61, 63], np.int32)),
            "soft": packed(soft),
            "sent": packed(np.packbits(bits, axis=1)),
            "start": packed(np.array([0.5, 0.75], np.float32)),
        }
    }
    browser.resize(1100, 900)
    browser.open(write(tmp_path, explorer(given, "cells")))
    got = browser.run(
        EXPLORER + "return e.opened.then(() => { e.cell = [3, 1]; e.draw(); return ["
        "e.samples, e.softly.textContent, e.counts.map((one) => [...one])] })"
    )
    samples, told, counts = got
    assert told == (
        "Soft values of the nearest cell that has them in this page, row 1, column 2: 3 symbols, 1 "
        "wrong. Above 0 the cell is decided as on."
    )
    assert [one["symbol"] for one in samples] == [60, 61, 63]
    assert [(one["before"], one["sent"], one["after"]) for one in samples] == [
        (0, 1, 0), (1, 0, 1), (1, 0, 1),
    ]  # fmt: skip
    want = [20.0, 20 * (64 / 127) ** 2, -20 * (64 / 127) ** 2]
    assert [one["soft"] for one in samples] == pytest.approx(want)
    assert [one["phase"] for one in samples] == [0.5, 0.75, 0.25]
    assert [sum(one) for one in counts] == [1, 0, 0, 2]  # off _ off, and on _ on
    browser.run("document.querySelectorAll('.raster')[2].focus()")
    browser.press("Right", "Right", "Right")
    column, level = browser.run(EXPLORER + "return e.bin")
    said = browser.run(EXPLORER + "return e.counted.textContent")
    assert column == 3 and "between on and on" in said
    assert f"{counts[3][2 * level]} symbols sent off, {counts[3][2 * level + 1]} sent on" in said
    moved = browser.run(
        EXPLORER + "e.against.value = 'phase'; e.of.value = 'all'; e.drawEye();"
        "return e.counts.map((one) => one.reduce((a, b) => a + b))"
    )
    phases = np.array([(start + 2.25 * n) % 1 for start in (0.5, 0.75) for n in (60, 61, 63)])
    assert moved == np.histogram(phases, 16)[0].tolist()
    assert browser.complaints() == []


def test_the_tiles_of_a_plan(browser: Browser, tmp_path: Path) -> None:
    kept = np.array([1, 0, 1, 0], np.uint8)
    given = {
        "rows": 2, "columns": 2, "first": 0, "checked": [1], "tiers": ["fast tier", "exact tier"],
        "tier": packed(np.array([0, 0, 1, 1], np.uint8)),
        "effects": [
            {"name": "shot noise", "kept": packed(kept),
             "bound": packed(np.array([0, 2e-4, 0, 1e-4], np.float32))}
        ],
    }  # fmt: skip
    browser.open(write(tmp_path, explorer(given, "tiles")))
    lines = browser.run(
        EXPLORER + "return e.opened.then(() => { e.tile = [1, 0]; e.draw();"
        "return [e.scale.textContent, ...[...e.facts.children].map((li) => li.textContent)] })"
    )
    assert lines == [
        "Blue: kept, in 2 of 4 tiles. Pale to orange: left out, where that changes the rate by at "
        "most 0 to 0.00020.",
        "Tile in row 0, column 1: fast tier, checked as a whole",
        "shot noise: left out, at most 0.00020",
    ]
    assert browser.complaints() == []


def test_a_screenshot_has_the_picture(opened: Browser, tmp_path: Path) -> None:
    opened.run("document.querySelector('.explorer').scrollIntoView()")
    opened.screenshot(tmp_path / "shot.png")
    shot = cv2.imread(str(tmp_path / "shot.png"), 0)
    assert shot is not None and shot.std() > 10
