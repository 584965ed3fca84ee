"""The report of a run in a real browser; `tests/browser` has the parts one by one."""

from __future__ import annotations

import base64
import csv
import io
import itertools

import pytest

from tests.browser.driver import Browser


@pytest.fixture
def opened(browser: Browser, step_run) -> Browser:
    browser.resize(1280, 900)
    browser.media()
    browser.open(step_run.folder / "report.html")
    return browser


def test_the_report_asks_for_nothing_and_has_no_fault(opened, step_run):
    opened.run("return Promise.all([...document.images].map(i => i.decode().catch(() => 0)))")
    assert opened.requests() == [(step_run.folder / "report.html").resolve().as_uri()]
    assert opened.complaints() == []
    assert opened.run("return document.documentElement.lang") == "en"


def test_every_figure_can_be_enlarged_and_every_plot_has_its_data(opened):
    figures = opened.run(
        "return [...document.querySelectorAll('figure')].filter(f => f.querySelector('img'))"
        ".map(f => { f.querySelector('.enlarge').click();"
        "const d = document.getElementById('large'), open = d.open; d.close();"
        "return [open, f.classList.contains('plot'), !!f.querySelector('a.data')] })"
    )
    assert len(figures) > 20
    assert all(open_ for open_, *_ in figures)
    assert [data for _, plot, data in figures if plot] == [True, True]


def test_the_data_of_the_map_are_the_tiles_of_the_plan(opened, step_run):
    link = "return document.querySelector('a[download=\"plan.csv\"]').href"
    coded = opened.run(link).split(",", 1)[1]
    head, *rows = csv.reader(io.StringIO(base64.b64decode(coded).decode()))
    assert head == ["row of tiles", "column of tiles", "set"]
    assert len(rows) == 25 * 16  # 400 x 250 pixels
    table = (
        "return [...document.querySelectorAll('#what-was-kept-and-what-was-left-out ~ *')]"
        ".map(e => e.querySelector('table')).filter(t => t && t.rows[0].cells[0].textContent"
        " === 'set').map(t => [...t.rows].slice(1).map(r => r.cells[1].textContent))[0]"
    )
    counts = [sum(row[2] == str(n + 1) for row in rows) for n in range(8)]
    assert [str(n) for n in counts if n] == opened.run(table)


def test_headings_are_in_order_and_the_contents_lead_to_them(opened):
    levels = opened.run(
        "return [...document.querySelectorAll('h1, h2, h3')].map(h => Number(h.tagName[1]))"
    )
    assert levels[0] == 1 and levels.count(1) == 1
    assert all(b <= a + 1 for a, b in itertools.pairwise(levels))
    ends = opened.run(
        "return [...document.querySelectorAll('nav a')]"
        ".map(a => document.getElementById(a.hash.slice(1))?.tagName)"
    )
    assert len(ends) > 8 and set(ends) == {"H2"}


@pytest.mark.parametrize("width", [320, 400, 768, 1280])
def test_the_page_never_scrolls_sideways(opened, width):
    opened.resize(width, 800)
    assert (
        opened.run("const e = document.documentElement; return e.scrollWidth - e.clientWidth") == 0
    )
    out = opened.run(
        "return [...document.querySelectorAll('.card, .answers dd, figure')]"
        ".filter(e => e.scrollWidth > e.clientWidth + 1).length"
    )
    assert out == 0


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_the_ground_follows_the_scheme(opened, scheme):
    opened.media(prefers_color_scheme=scheme)
    ground = opened.run("return getComputedStyle(document.body).backgroundColor")
    assert (int(ground.split("(")[1].split(",")[0]) < 60) == (scheme == "dark")


def test_the_report_prints(opened):
    assert opened.pdf().startswith(b"%PDF-")
