"""The page of a report in a real browser: nothing from outside, mouse and keyboard, dark, narrow,
print. The page is made here, of one part of each kind."""

from __future__ import annotations

import csv
import io
import re
from urllib.parse import unquote_to_bytes

import cv2
import numpy as np
import pytest

from cosim.report.drawn import save_figure
from cosim.report.figures import subplots
from cosim.report.page import write_page
from cosim.report.parts import cards, figure, plot, table
from tests.browser.driver import Browser

X, Y = [0.0, 0.5, 1.0, 1.5], [1.0, 2.5, 1e-7, 4e6]
NARROW = 400
SCRIPT = "document.body.dataset.further = String(document.querySelectorAll('h2').length)"


@pytest.fixture(scope="module")
def page(tmp_path_factory):
    folder = tmp_path_factory.mktemp("page")
    drawing, ax = subplots(figsize=(12, 4))
    ax.plot(X, Y, label='light, in "lux"')
    ax.set_xlabel("time, ms")
    ax.set_ylabel("light, lux")
    data = save_figure(drawing, folder / "light.png")
    pixels = np.arange(64, dtype=np.uint8).reshape(8, 8) * 4
    wide = table(
        ["what", *(f"a heading of column {n}" for n in range(9))], [["TFP"] + ["12.5 ms"] * 9]
    )
    head = "<h1>A page</h1>" + cards([("first", "12.3 dB", "W" * 60)]) + "<p>PSNR of TFP.</p>"
    sections = (
        "<h2>One</h2><p>TFP, TFI, and TFP once more.</p>"
        + plot(folder / "light.png", "light over time", data)
        + "<h2>Two</h2><p>A spike and TFP.</p>" + figure(pixels, "eight by eight", exact=True)
        + wide + f"<pre>{'x' * 300}</pre>"
    )  # fmt: skip
    write_page(folder, "A page & more", head, sections, [SCRIPT])
    return folder / "report.html"


@pytest.fixture
def opened(browser: Browser, page) -> Browser:
    browser.resize(1280, 900)
    browser.media()
    browser.open(page)
    return browser


def test_nothing_is_asked_for_and_nothing_is_complained_of(opened, page):
    assert opened.requests() == [page.resolve().as_uri()]
    assert opened.complaints() == []


def test_the_policy_of_the_page_stops_what_would_leave_it(opened):
    opened.run("const i = new Image(); i.src = 'http://127.0.0.1:9/x.png'; document.body.append(i)")
    reached = opened.run("return fetch('http://127.0.0.1:9/').then(() => true, () => false)")
    assert reached is False
    assert any("Content Security Policy" in message for message in opened.complaints())


def test_further_scripts_are_in_the_page(opened):
    assert opened.run("return document.body.dataset.further") == "3"  # with the terms


def shown(browser: Browser) -> dict:
    return browser.run(
        "const d = document.getElementById('large'), p = document.getElementById('large-picture');"
        "return p.decode().catch(() => 0).then(() => ({open: d.open, alt: p.alt, src: p.src,"
        "wide: p.getBoundingClientRect().width, own: p.naturalWidth,"
        "rendering: getComputedStyle(p).imageRendering,"
        "focus: document.activeElement.getAttribute('aria-label') || ''}))"
    )


def test_a_figure_is_enlarged_by_the_mouse(opened):
    opened.click("figure.plot img")
    large = shown(opened)
    assert large["open"] and large["alt"] == "light over time"
    assert large["src"] == opened.run("return document.querySelector('figure.plot img').src")
    opened.click("#large-close")
    assert not shown(opened)["open"]


def test_a_figure_is_enlarged_by_the_keyboard(opened):
    opened.run("document.querySelector('figure.plot .enlarge').focus()")
    opened.press("Enter")
    assert shown(opened)["open"]
    opened.press("Escape")
    closed = shown(opened)
    assert not closed["open"]
    assert closed["focus"] == "Enlarge: light over time"  # back where it was


def test_a_map_of_pixels_grows_by_whole_factors_with_sharp_edges(opened):
    opened.click("figure.picture .enlarge")
    large = shown(opened)
    assert large["own"] == 8
    assert large["rendering"] == "pixelated"
    assert large["wide"] > 400 and large["wide"] % 8 == 0
    inline = "return getComputedStyle(document.querySelector('figure.picture img')).imageRendering"
    assert opened.run(inline) == "pixelated"


def test_the_data_of_a_figure_are_the_numbers_drawn(opened):
    link = opened.run(
        "const a = document.querySelector('a.data'); return [a.download, a.href, a.textContent]"
    )
    assert link[0] == "light.csv" and link[2] == "Data (CSV)"
    content = opened.run("return fetch(arguments[0]).then(r => r.text(), e => '')", link[1])
    assert content == ""  # not even data may be fetched: the link is for the person
    kind, coded = link[1].split(",", 1)
    assert kind == "data:text/csv;base64"
    import base64

    head, *rows = csv.reader(io.StringIO(base64.b64decode(unquote_to_bytes(coded)).decode()))
    assert head == ["time, ms", "light, lux"]
    assert [[float(cell) for cell in row] for row in rows] == [
        [x, pytest.approx(y, rel=1e-5)] for x, y in zip(X, Y, strict=True)
    ]


def test_the_first_use_of_a_term_in_a_section_has_its_definition(opened):
    marked = opened.run("return [...document.querySelectorAll('dfn')].map(d => d.textContent)")
    assert marked == ["PSNR", "TFP", "TFP", "TFI", "spike", "TFP"]
    opened.run("document.querySelectorAll('dfn')[3].focus()")
    note = "const n = document.getElementById('definition'); return [n.hidden, n.textContent]"
    hidden, text = opened.run(note)
    assert not hidden and text.startswith("Texture from interval")
    described = "return document.querySelectorAll('dfn')[3].getAttribute('aria-describedby')"
    assert opened.run(described) == "definition"
    opened.press("Escape")
    assert opened.run(note)[0]
    opened.click("dfn")  # a touch is a click
    assert opened.run(note)[1].startswith("Peak signal-to-noise ratio")


def test_the_whole_page_can_be_walked_by_the_tab_key(opened):
    stops = []
    for _ in range(60):
        opened.press("Tab")
        stop = opened.run(
            "const e = document.activeElement, s = getComputedStyle(e);"
            "return [e.tagName, e.textContent.slice(0, 30), s.outlineStyle]"
        )
        if stop[0] == "BODY":
            break
        stops.append(stop)
    assert stops[0][1] == "Skip to the report"
    assert {name for name, *_ in stops} == {"A", "DFN", "BUTTON", "PRE"}
    assert all(outline != "none" for *_, outline in stops)


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_is_readable_in_light_and_in_dark(opened, scheme):
    """Contrast of 4.5 or more (WCAG 2.2, 1.4.3)."""
    opened.media(prefers_color_scheme=scheme)
    colours = opened.run(
        "const back = e => { for (; e; e = e.parentElement) { const c ="
        " getComputedStyle(e).backgroundColor; if (!c.includes(', 0)')) return c; } };"
        "return [...document.querySelectorAll('p, .soft, a, td, h1, h2, figcaption, button, pre')]"
        ".filter(e => e.checkVisibility()).map(e => [getComputedStyle(e).color, back(e)])"
    )

    def luminance(colour: str) -> float:
        levels = np.array([int(v) for v in re.findall(r"\d+", colour)[:3]]) / 255
        linear = np.where(levels <= 0.04045, levels / 12.92, ((levels + 0.055) / 1.055) ** 2.4)
        return float(linear @ [0.2126, 0.7152, 0.0722])

    assert len(colours) > 15
    grounds = set()
    for ink, ground in colours:
        low, high = sorted((luminance(ink), luminance(ground)))
        assert (high + 0.05) / (low + 0.05) >= 4.5, (ink, ground)
        grounds.add(round(luminance(ground), 1))
    assert grounds <= ({0.0} if scheme == "dark" else {0.9, 1.0})


def test_a_plot_stays_a_light_card_in_the_dark(opened):
    opened.media(prefers_color_scheme="dark")
    plain = "return getComputedStyle(document.querySelector('figure.plot img')).backgroundColor"
    assert opened.run(plain) == "rgb(255, 255, 255)"
    seen = cv2.imdecode(np.frombuffer(opened.screenshot(), np.uint8), cv2.IMREAD_GRAYSCALE)
    assert (seen < 40).mean() > 0.3 and (seen > 240).mean() > 0.05


def test_a_narrow_screen_scrolls_down_alone(opened):
    opened.resize(NARROW, 800)
    wide = "const e = document.documentElement; return [e.scrollWidth - e.clientWidth, innerWidth]"
    assert opened.run(wide) == [0, NARROW]
    cues = opened.run(
        "return [...document.querySelectorAll('.wide')].map(b => [b.classList.contains('over'),"
        "getComputedStyle(b, '::before').content, b.firstChild.tabIndex])"
    )
    assert cues == [[True, '"Wider than the screen: scroll sideways →"', 0]]
    assert opened.run("return document.querySelector('pre').classList.contains('over')")


def test_a_card_holds_its_text(opened):
    opened.resize(NARROW, 800)
    inside = "const c = document.querySelector('.card'); return [c.scrollWidth, c.clientWidth]"
    scroll, client = opened.run(inside)
    assert scroll <= client


def test_print_is_dark_on_light_without_controls(opened):
    opened.media("print", prefers_color_scheme="dark")
    assert opened.run("return getComputedStyle(document.body).color") == "rgb(0, 0, 0)"
    hidden = "nav, .tools, .skip, #definition"
    assert opened.run(
        "return [...document.querySelectorAll(arguments[0])].every(e => !e.checkVisibility())",
        hidden,
    )
    assert opened.pdf().startswith(b"%PDF-")
