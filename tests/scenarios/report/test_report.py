"""The report: one file that needs nothing else, whatever the run was."""

from __future__ import annotations

import base64
import html
import re
import shlex
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path
from types import SimpleNamespace

import av
import cv2
import numpy as np
import pytest

from cosim import Clock, Viform
from cosim.config.amounts import elapsed, number
from cosim.config.toml import to_toml
from cosim.report.pictures import accumulation, busiest_box, enlarge, mark_pixels
from cosim.report.png import for_display, to_linear_bytes
from cosim.run.result import Metric
from scenarios.assemble.schema.loading import load
from scenarios.cli.scenario.run import print_result
from scenarios.report import write_report
from scenarios.report.frame import _long
from sensor import EFFECTS
from sensor.latched.effects.own_draws import OWN_DRAWS, SOURCE

VOID = {"meta", "img", "br"}


class Page(HTMLParser):
    """A page's elements; fails where they do not nest."""

    def __init__(self, path: Path) -> None:
        super().__init__()
        self.open: list[str] = []
        self.elements: list[tuple[str, dict[str, str]]] = []
        self.text: dict[str, list[str]] = {}
        self.data: list[bytes] = []
        whole = path.read_text(encoding="utf-8")
        self.source = re.sub(r"(?<=;base64,)[\w+/=]+", self._keep, whole)
        self.plain = html.unescape(re.sub(r"</?dfn[^>]*>", "", self.source))
        self.feed(self.source)
        self.close()
        assert self.open == []

    def _keep(self, found: re.Match[str]) -> str:
        """Takes embedded files out of the text; their numbers stay there."""
        self.data.append(base64.b64decode(found[0], validate=True))
        return str(len(self.data) - 1)

    def handle_starttag(self, tag, attrs):
        self.elements.append((tag, {key: value or "" for key, value in attrs}))
        self.text.setdefault(tag, [])
        if tag not in VOID:
            self.open.append(tag)
            self.text[tag].append("")

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open:
            self.text[self.open[-1]][-1] += data

    def embedded(self, tag: str) -> list[bytes]:
        sources = [a["src"] for name, a in self.elements if name == tag and "src" in a]
        return [self.data[int(source.split(",")[1])] for source in sources]


@pytest.fixture(scope="module")
def page(step_run) -> Page:
    return Page(step_run.folder / "report.html")


@pytest.fixture(scope="module")
def tiny(odd) -> Page:
    return odd[0]


@pytest.fixture(scope="module")
def odd(film, tmp_path_factory) -> tuple[Page, Path]:
    """41 cycles, the fewest, which end before the light jumps, so that nothing moves; in a folder
    with a blank, with markup where it may occur."""

    def report(machine, run):
        run.notes.append("<b>&note")
        run.result.device = "<i>&device"
        return write_report(machine, run)

    folder = tmp_path_factory.mktemp("odd") / "my run"
    film("step", folder, "duration=1.025 ms", "image.at=[]", report=report)
    return Page(folder / "report.html"), folder


@pytest.mark.parametrize("which", ["page", "tiny"])
def test_the_page_needs_no_network_and_no_other_file(which, request):
    page = request.getfixturevalue(which)
    text = re.sub(r'"[A-Za-z0-9+/=]{40,}"', '""', page.source)  # without the data of explorers
    assert not re.search(r"https?:|//[a-z]|@import|url\(", text)
    names = {name for name, _ in page.elements}
    assert not names & {"link", "iframe", "object", "embed", "base", "form"}
    policy = "default-src 'none'; img-src data:; media-src data:; "
    assert any(a.get("content", "").startswith(policy) for _, a in page.elements)
    for name, attributes in page.elements:
        assert not any(key in attributes for key in ("srcset", "poster", "data"))
        assert not any(key.startswith("on") for key in attributes)
        assert name != "script" or attributes in ({}, {"type": "application/json"})
        if "href" in attributes:
            assert re.fullmatch(r"#[\w-]+|data:text/csv;base64,\d+", attributes["href"])
        if "src" in attributes:
            assert re.fullmatch(
                r"data:(image/png|image/jpeg|video/mp4);base64,\d+", attributes["src"]
            )


@pytest.mark.parametrize("which", ["page", "tiny"])
def test_every_picture_decodes_and_has_a_caption(which, request):
    page = request.getfixturevalue(which)
    pictures = page.embedded("img")
    assert len(pictures) > 20
    for data in pictures:
        assert cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR) is not None
    shown = [a for name, a in page.elements if name == "img" and "src" in a]
    assert all(attributes["alt"] for attributes in shown)
    captions = [text for text in page.text["figcaption"] if text]
    assert len(captions) == len(shown) + 1  # and one for the clip


def test_the_title_is_text_and_never_markup(page):
    title = "A step <script>alert(1)</script> & more"
    assert page.text["title"] == [title]
    assert page.text["h1"] == [title]
    code = [name for name, given in page.elements if name == "script" and not given]
    assert len(code) == 2 and "alert(1)</script>" not in page.source  # of page and explorers


def test_the_page_holds_the_resolved_scenario_and_how_to_make_it_again(page, step_run):
    again, scenario = page.text["pre"]
    assert scenario == to_toml(load(str(step_run.folder))[1])
    image, run = again.splitlines()
    white = step_run.result.metrics["white_rate"].value
    assert image == (
        f"viform image {step_run.folder} --at 50 --method tfp --window 41 --scale {white!r} "
        "--out a.png"
    )
    assert run == f"viform run {step_run.folder / 'scenario.toml'}"


def test_terminal_and_report_give_one_time_of_the_camera(step_run, capsys):
    """That of a link is its air and its sensor."""
    result = replace(step_run.result, metrics={**step_run.result.metrics})
    result.metrics["camera"] = Metric(29.5, "s")
    run = SimpleNamespace(result=result, seconds={"sensor": 12.6, "air": 16.9})
    print_result(result, step_run.folder, [], [], json=False)
    assert ", which took 29.5 s" in capsys.readouterr().out
    assert "in this run the camera took 29.5 s" in _long(run, 40.0)


def test_error_run_time_and_what_was_left_out_come_first(page, step_run):
    figures, error = page.text["b"][3:6], step_run.result.error
    assert figures[0].replace("\xa0", " ") == number(error.value, 2)  # one line in a page
    said = (
        f"at most {number(error.ci[1], 2)} in any tile (99.9 % confidence): {error.kind}; "
        "tolerance 0.001"
    )
    assert said in page.plain
    assert re.fullmatch(r"\d+\.?\d* m?s", figures[1])
    full = step_run.result.metrics["full_physics"].value
    assert f"take the camera about {elapsed(full)}, predicted from the patches" in page.plain
    assert figures[2].startswith(f"{len(step_run.result.left_out)} ")
    questions = page.text["dt"][:6]
    assert questions == [
        "What was simulated", "How good the camera is", "How wrong the simulation may be",
        "How long it took", "What was left out", "Notes of the run",
    ]  # fmt: skip
    assert page.source.index('class="answers"') < page.source.index("<img")


def test_figures_on_the_page_are_those_of_the_document(page, step_run):
    metrics = step_run.result.metrics
    assert page.text["b"][:3] == [
        f"{metrics['tfp_psnr'].value:.1f} dB",
        f"{metrics['tfi_psnr'].value:.1f} dB",
        number(metrics["spike_rate"].value),
    ]
    assert f"SSIM {number(metrics['tfp_ssim'].value)}" in page.plain


def test_every_effect_of_the_camera_is_in_the_table_with_its_share(page, step_run):
    rows = re.findall(
        r"<tr><td>([^<]*)</td><td>([^<]* %)</td>" + r"<td>([^<]*)</td>" * 5 + "</tr>", page.source
    )
    kept = {row[0]: row[1] for row in rows}
    sources = {name: effect.source for name, effect in EFFECTS.items()} | {OWN_DRAWS: SOURCE}
    assert set(kept) == set(sources)
    out = {row["effect"] for row in step_run.result.left_out}
    assert {name for name, share in kept.items() if share != "100 %"} == out
    assert [row[6] for row in rows] == [sources[row[0]] for row in rows]
    assert "Nothing was left out" not in page.source and "not measured yet" not in page.source


def test_what_was_assumed_of_the_chip_is_said_to_be(page):
    rows = re.findall(r"<tr><td>(.*?)</td><td>(.*?)</td><td>(.*?)</td></tr>", page.source)
    found = {what: origin for what, _, origin in rows}
    assert found["pixels"] == found["latch clock"] == "published"
    assert found["pixel pitch"] == found["quantum efficiency"] == found["fill factor"] == "assumed"


def test_notes_and_a_degraded_outcome_are_on_the_page(odd):
    page, _ = odd
    assert "Outcome: degraded." in page.text["b"]
    notes = [text for text in page.text["li"] if text]
    assert "no verdict on the data" in page.plain
    assert notes.pop(1).startswith("the run needs about ")  # differs from device to device
    assert notes == [
        "f/1.37 chosen so that white fires at 0.6 a cycle",
        "the light steps at 32 ms, constant before and after",
        "the run ends before the step of the light: lengthen duration",
        "<b>&note",
    ]


def test_markup_in_a_note_or_a_device_s_name_is_text(odd):
    page, _ = odd
    assert html.escape("<i>&device") in page.source
    assert "<i>" not in page.source


def test_the_lines_to_make_it_again_survive_a_folder_with_blanks(odd):
    page, folder = odd
    image, run = page.text["pre"][0].splitlines()
    assert shlex.split(image)[2] == str(folder)
    assert shlex.split(run) == ["viform", "run", f"{folder}/scenario.toml"]


def test_a_scene_in_which_nothing_moves_is_said_to_stand_still(tiny, page):
    assert "The images of this run show no motion." in tiny.source
    assert "Nothing moves" not in page.source


def test_only_accumulations_that_the_run_holds_are_shown(tiny, page):
    def windows(page: Page) -> list[str]:
        return [c for c in page.text["figcaption"] if re.match(r"\d+ cycles?, ", c)]

    assert windows(page) == ["1 cycle, 0.025 ms", "2 cycles, 0.05 ms", "5 cycles, 0.125 ms",
                             "50 cycles, 1.25 ms"]  # fmt: skip
    assert windows(tiny) == windows(page)[:3]


def test_the_playback_is_a_clip_of_the_run(page, step_run):
    assert page.embedded("video") == [(step_run.folder / "playback.mp4").read_bytes()]
    with av.open(str(step_run.folder / "playback.mp4")) as container:
        frames = [frame.to_ndarray(format="gray") for frame in container.decode(video=0)]
    assert len(frames) == 100
    # White's 0.6 before and after the jump, through the sRGB curve; H.264 is near, not exact.
    for n, level in ((20, 0.1), (80, 0.9)):
        bar = frames[n][:, 355:395].mean()
        assert bar == pytest.approx(for_display(np.full((1, 1), level, np.float32))[0, 0], abs=6)


# The pictures.


def stream_of(*rates: float, cycles: int = 200) -> Viform:
    """Pixels in a row that fire every 1/rate cycles."""
    due = np.floor(np.arange(1, cycles + 1)[:, None] * np.array(rates))
    planes = np.diff(due, axis=0, prepend=0) > 0
    return Viform.from_planes(planes[:, None, :], Clock(40_000))


def test_accumulated_white_is_white_and_a_single_cycle_shows_single_spikes():
    stream = stream_of(0.0, 0.25, 0.5)
    half = for_display(np.full((1, 1), 0.5, np.float32))[0, 0]
    np.testing.assert_array_equal(accumulation(stream, 200, 0.5), [[0, half, 255]])
    np.testing.assert_array_equal(accumulation(stream, 1, 0.5, 1), [[0, 0, 255]])
    np.testing.assert_array_equal(accumulation(stream, 1, 0.5, 3), [[0, 255, 255]])
    np.testing.assert_array_equal(accumulation(stream, 1, 0.5, 4), [[0, 0, 0]])


@pytest.mark.parametrize("side", [1, 2, 3, 8, 50])
def test_the_busiest_box_holds_the_largest_sum(side):
    change = np.random.default_rng(side).random((20, 31)).astype(np.float32)
    y0, y1, x0, x1 = busiest_box(change, side)
    size = min(side, 20)
    assert (y1 - y0, x1 - x0) == (size, size)
    sums = [
        change[y : y + size, x : x + size].sum()
        for y in range(20 - size + 1)
        for x in range(31 - size + 1)
    ]
    assert change[y0:y1, x0:x1].sum() == pytest.approx(max(sums), rel=1e-5)


def test_enlarged_pixels_stay_pixels():
    image = np.arange(6, dtype=np.uint8).reshape(2, 3)
    large = enlarge(image, 10)
    assert large.shape == (8, 12)
    np.testing.assert_array_equal(large[::4, ::4], image)
    np.testing.assert_array_equal(large[3::4, 3::4], image)


@pytest.mark.parametrize("shape", [(8, 8), (250, 400), (1000, 1000)])
def test_every_pixel_is_marked_in_its_place_even_in_a_corner(shape):
    image = np.full(shape, 128, np.uint8)
    corners = [(0, 0), (0, shape[1] - 1), (shape[0] - 1, 0), (shape[0] - 1, shape[1] - 1)]
    marked = mark_pixels(image, [(row, column, "") for row, column in corners])
    times = marked.shape[1] // shape[1]
    colour = (marked != marked[..., :1]).any(axis=-1)
    for row, column in corners:
        reach = 40
        y, x = row * times + times // 2, column * times + times // 2
        assert colour[max(y - reach, 0) : y + reach, max(x - reach, 0) : x + reach].any()
    assert not colour[marked.shape[0] // 2, marked.shape[1] // 2]


def test_the_display_curve_is_srgb_and_the_linear_one_is_not():
    levels = np.array([[0, 0.0031308, 0.2140, 0.5, 1, 1.5, -0.5]], np.float32)
    # IEC 61966-2-1: 12.92 x, then 1.055 x^(1/2.4) - 0.055.
    np.testing.assert_array_equal(for_display(levels), [[0, 10, 127, 188, 255, 255, 0]])
    np.testing.assert_array_equal(to_linear_bytes(levels), [[0, 1, 55, 128, 255, 255, 0]])
