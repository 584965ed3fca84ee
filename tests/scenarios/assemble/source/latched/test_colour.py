"""Runs of a chip with colour filters: the chart read back, clips in colour, the panel, refusals."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest

from cosim.light.mosaic import Mosaic, balanced, delta_e, delta_e_2000, lab
from cosim.report.png import coloured
from cosim.run.result import Result
from scenarios.scenes.charts.patches import PATCHES, ColourChart, linear
from sensor.device.crosstalk import response

CHART = (
    "scene.drawn=colour-chart", "sensor.colour.filter=rggb", "duration=25 ms", "image.at=[600]",
    "sensor.chip=spikeone", "sensor.lens.white_rate=0.25",
)  # fmt: skip
SHAPE = (250, 400)
Film = Callable[..., tuple[Result, Path]]


def picture(path: Path) -> np.ndarray:
    """Linear red, green and blue of a colour picture."""
    made = cv2.imread(str(path))
    assert made is not None
    return linear(made[..., ::-1])


@pytest.fixture(scope="module")
def chart(film: Film, tmp_path_factory: pytest.TempPathFactory) -> tuple[Result, Path]:
    return film("film", tmp_path_factory.mktemp("colour") / "run", *CHART, small=False)


def test_the_patches_of_the_chart_are_read_back(chart: tuple[Result, Path]) -> None:
    """Mean colour of each patch in the pictures, against the published one. Intervals of white are
    4 cycles, and the longest that end before the picture are 600."""
    result, folder = chart
    assert result.outcome == "ok"
    images = {m: picture(folder / f"images/colour-{m}-00600.png") for m in ("truth", "tfi")}
    grid = ColourChart(SHAPE, 1.0)
    for number, (name, codes) in enumerate(PATCHES):
        y0, y1, x0, x1 = grid.patch(number)
        published = linear(codes)[None, None]
        for method, most in (("truth", 0.8), ("tfi", 1.5)):
            patch = images[method][y0 + 4 : y1 - 4, x0 + 4 : x1 - 4]
            mean = patch.mean(axis=(0, 1), keepdims=True)
            difference = float(delta_e(mean, published).item())
            assert difference < most, (name, method, difference)


def test_a_run_in_colour_has_a_colour_difference(chart: tuple[Result, Path]) -> None:
    result, folder = chart
    assert 0 < result.metrics["tfi_delta_e"].value < result.metrics["tfp_delta_e"].value
    assert {f"images/colour-{m}-00600.png" for m in ("truth", "tfp", "tfi")} <= set(result.files)
    assert all((folder / name).exists() for name in result.files)


def test_without_filters_the_chart_is_luminance(film: Film, tmp_path: Path) -> None:
    _, folder = film(
        "film", tmp_path / "run", *(s for s in CHART if "filter" not in s), small=False
    )
    assert not list((folder / "images").glob("colour-*"))
    grey = picture(folder / "images/truth-00600.png")
    y0, _, x0, _ = ColourChart(SHAPE, 1.0).patch(12)
    made = cv2.imread(str(folder / "images/truth-00600.png"))[y0 + 5, x0 + 5, 0] / 255
    blue = float(linear(PATCHES[12][1]) @ (0.2126, 0.7152, 0.0722))
    assert grey.shape == (*SHAPE, 3) and made == pytest.approx(blue, abs=1 / 255)


def test_a_clip_keeps_its_colours(
    film: Film, make_clip: Callable[..., Path], tmp_path: Path
) -> None:
    """Three stripes of a clip, red, green and blue, and one of each with the others."""
    colours = np.array([[200, 30, 40], [40, 180, 50], [30, 60, 210], [200, 190, 40]], np.uint8)
    frame = np.repeat(np.repeat(colours[None], 250, axis=0), 100, axis=1)
    clip = make_clip(tmp_path / "clip.mkv", np.repeat(frame[None], 3, axis=0), rate=25)
    sets = (f"scene.path={clip}", *(s for s in CHART if "drawn" not in s))
    _, folder = film("film", tmp_path / "run", *sets, small=False)
    truth = picture(folder / "images/colour-truth-00600.png")
    for n, codes in enumerate(colours):
        patch = truth[20:-20, 100 * n + 10 : 100 * n + 90].mean(axis=(0, 1), keepdims=True)
        assert float(delta_e(patch, linear(codes)[None, None]).item()) < 1.0


def test_white_is_grey_behind_a_filter_array(film: Film, tmp_path: Path) -> None:
    """A scene without colours: equal red, green and blue after balance, signals of the filters."""
    sets = ("sensor.colour.filter=gbrg", "scene.at=4 ms", "duration=3 ms")
    _, folder = film("step", tmp_path / "run", *sets)
    name = next((folder / "images").glob("colour-truth-*.png"))
    made = cv2.imread(str(name))
    spread = np.ptp(made.astype(int), axis=2)
    assert (spread <= 1).mean() > 0.8  # all but edges, where colours are interpolated


@pytest.mark.slow
def test_the_panel_emits_the_colours_of_the_camera(film: Film, tmp_path: Path) -> None:
    """The true light of the panel is the scene's; its colours are the camera's, balanced."""
    sets = ("display.colour=as-camera", "duration=3 ms")
    _, folder = film("film", tmp_path / "run", *CHART[:2], CHART[4], *sets, small=False)
    found = sorted((folder / "images").glob("colour-*-truth.png"))
    assert found
    made = linear(cv2.imread(str(found[0]))[..., ::-1])
    mosaic = Mosaic("rggb", response(3.0, 550.0))
    chart = ColourChart(SHAPE, 1.0, mosaic)
    expected = linear(coloured(balanced(mosaic, chart.truth(0)))[..., ::-1])
    for number in range(len(PATCHES)):
        y0, y1, x0, x1 = chart.patch(number)
        inside = np.s_[y0 + 6 : y1 - 6, x0 + 6 : x1 - 6]
        np.testing.assert_allclose(
            made[inside].mean(axis=(0, 1)), expected[inside].mean(axis=(0, 1)), atol=0.02
        )


PANEL = (
    "scene.drawn=colour-chart", "sensor.colour.filter=rggb", "sensor.width=96", "sensor.height=64",
    "display.beside=[]", "display.projector=none",
)  # fmt: skip


def test_a_matrix_fitted_to_the_chart_corrects_the_panel(film: Film, tmp_path: Path) -> None:
    """What an eye sees of the patches: the matrix takes off what the filters mix, at least 3 of
    CIEDE2000 by the mean of the chart, as their response says."""
    mosaic = Mosaic("rggb", response(3.0, 550.0))
    true = linear([codes for _, codes in PATCHES])
    mixed = delta_e_2000(lab(true @ mosaic.camera.T), lab(true))
    seen = {}
    for colour in ("matrix", "as-camera"):
        sets = (*PANEL, f"display.colour={colour}", "duration=16 ms", "image.at=[400]")
        result, folder = film("film", tmp_path / colour, *sets, small=False)
        seen[colour] = result.metrics["eye_delta_e_2000"].value
        assert seen[colour] < result.metrics["eye_delta_e_2000_max"].value
        assert (folder / "images/colour-eye-spike.png").exists()
    assert seen["matrix"] < 1 and seen["as-camera"] == pytest.approx(mixed.mean(), abs=0.3)


@pytest.mark.slow
def test_colour_crosses_camera_link_and_panel(film: Film, tmp_path: Path) -> None:
    sets = (
        *PANEL, "scene.kind=film", "display.colour=matrix", "duration=16 ms", "image.at=[400]",
        "link.panel.width=192", "link.panel.height=192", "link.sensor.chip=spikeone",
        "code.cycles=64", "code.tile=32",
    )  # fmt: skip
    result, folder = film("glass-over-light", tmp_path / "run", *sets, small=False)
    assert result.metrics["eye_delta_e_2000"].value < 1
    assert (folder / "images/colour-eye-spike.png").exists()


def test_a_picture_without_light_or_too_small_has_no_differences() -> None:
    assert ColourChart(SHAPE, 1.0).differences(np.zeros((*SHAPE, 3), np.float32)) is None
    small = (32, 48)
    assert ColourChart(small, 1.0).differences(np.ones((*small, 3), np.float32)) is None


@pytest.mark.parametrize(
    ("sets", "key"),
    [
        (("sensor.colour.filter=rggb", "sensor.lens.psf=airy"), "sensor.lens.psf"),
        (("sensor.colour.filter=rgbg",), "sensor.colour.filter"),
        (("sensor.colour.filter=rggb", "sensor.colour.depth=0 um"), "sensor.colour.depth"),
        (("display.colour=as-camera",), "display.colour"),
        (
            ("sensor.colour.filter=rggb", "display.colour=as-camera", "display.fit=centre"),
            "display.colour",
        ),
        (("sensor.colour.filter=rggb", "sensor.pixel=asynchronous"), "sensor.colour"),
    ],
)
def test_what_cannot_be_in_colour_is_refused(
    refused: Callable[..., str], sets: tuple[str, ...], key: str, tmp_path: Path
) -> None:
    words = [word for pair in sets for word in ("--set", pair)]
    assert key in refused("run", "film", *words, "--out", tmp_path / "run")
    assert not (tmp_path / "run").exists()
