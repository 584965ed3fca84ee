"""`viform compare`: scenery that stands and runs, blur and noise of known pictures, the command."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.special import ndtr

from cosim import PS, InputError
from cosim.run.progress import QuietProgress
from imagers.adaptive.model import AdaptiveComparison
from imagers.adaptive.pixels import AdaptivePixels
from imagers.common.scenery import Course, Still
from imagers.ebaps.model import EbapsComparison
from imagers.ebaps.section import EbapsSection
from imagers.emccd.model import EmccdComparison
from imagers.emccd.pixels import EmccdPixels, without_smear
from imagers.emccd.section import EmccdSection
from imagers.pulse.model import DARKEST, PulseModel, PwmComparison
from imagers.pulse.section import PwmSection
from scenarios.studies.compare import load_comparison, run_compare
from scenarios.studies.compare.frames import ends, one_frame, with_controls
from scenarios.studies.compare.measure import EDGE, FIGURES, noise, still_blur
from scenarios.studies.compare.motion import RAMP, Motion
from scenarios.studies.compare.run_in import Placed, RunIn
from scenarios.studies.compare.setting import SHAPE
from sensor.frame_pixels import Exposed

MS = PS // 1000
WIDE = (40, 160)


def stripes(speed: float) -> Callable[[int], Any]:
    """Bars of 24 pixels that move by `speed` pixels a second, soft at their edges."""

    def truth(ps: int) -> Any:
        y, x = np.indices(WIDE)
        along = x + 0.1 * y - speed * ps / PS  # tilted, so that edges lie anywhere on the pixels
        return 0.5 + 0.4 * np.clip(8 * np.sin(2 * np.pi * along / 48), -1, 1)

    return truth


@pytest.mark.parametrize("span", [2 * MS, 9 * MS, 20 * MS])
def test_motion_finds_the_span_that_an_image_is_the_mean_of(span: int) -> None:
    """A mean over `span`, with noise of a fifth; 20 ms at 1500 pixels/s is over a bar's length,
    where contrast turns around. An edge's 10 to 90 % is 0.8 of its way."""
    speed, middle = 1500.0, 40 * MS
    truth = stripes(speed)
    times = np.linspace(middle - span // 2, middle + span // 2, 401)
    image = np.mean([truth(int(t)) for t in times], axis=0)
    image = 30 + 0.93 * (image + np.random.default_rng(1).normal(0, 0.1, WIDE))
    motion = Motion(truth, middle, 30 * MS, MS // 4, 80 * MS)
    instants = np.full(WIDE[0], middle)
    assert motion.span(image, instants) == pytest.approx(span / PS, rel=0.05)
    assert motion.speed() == pytest.approx(speed, rel=0.1)
    blur, unknown = motion.blur(image, instants)
    assert (blur, unknown) == (pytest.approx(RAMP * speed * span / PS, rel=0.15), "")


def test_rows_at_their_own_instants_are_no_blur() -> None:
    truth = stripes(1500.0)
    instants = np.linspace(36 * MS, 44 * MS, WIDE[0]).astype(np.int64)
    image = np.stack([
        np.mean([truth(int(t))[n] for t in np.linspace(i - MS, i + MS, 41)], axis=0)
        for n, i in enumerate(instants)
    ])  # fmt: skip
    motion = Motion(truth, 40 * MS, 30 * MS, MS // 4, 80 * MS)
    assert motion.span(image, instants) == pytest.approx(2e-3, rel=0.2)
    assert motion.span(image, np.full(WIDE[0], 40 * MS)) > 4e-3


def test_what_stands_still_or_shows_nothing_has_no_motion() -> None:
    motion = Motion(stripes(0.0), 40 * MS, 30 * MS, MS, 80 * MS)
    assert motion.moving() is None and motion.speed() is None
    drawn = np.random.default_rng(2).normal(0, 1, WIDE)
    moves = Motion(stripes(1500.0), 40 * MS, 30 * MS, MS, 80 * MS)
    assert moves.span(drawn, np.full(WIDE[0], 40 * MS)) is None


def soft_stripes(speed: float) -> Any:
    """A blurry clip: waves of 44 pixels, whose gradient is just enough for an edge."""

    def truth(ps: int) -> Any:
        x = np.indices(WIDE)[1] - speed * ps / PS
        return 0.5 + 0.4 * np.sin(2 * np.pi * x / 44)

    return truth


@pytest.mark.parametrize("exposure", [0, 1])
def test_a_blur_that_nothing_tells_from_none_is_unknown(exposure: int) -> None:
    """Of a blurry clip: 1 ms of a slow wave changes less than the noise of the image."""
    truth, middle = soft_stripes(300.0), 40 * MS
    times = np.linspace(middle - exposure * MS // 2, middle + exposure * MS // 2, 41)
    image = np.mean([truth(int(t)) for t in times], axis=0)
    image += np.random.default_rng(3).normal(0, 0.05, WIDE)
    motion = Motion(truth, middle, 30 * MS, MS // 8, 80 * MS)
    blur, unknown = motion.blur(image, np.full(WIDE[0], middle))
    assert blur is None and "too" in unknown
    # edges: the same speed and noise, and the blur is measured
    truth = stripes(1500.0)
    image = np.mean([truth(int(t)) for t in np.linspace(38 * MS, 42 * MS, 41)], axis=0)
    image += np.random.default_rng(3).normal(0, 0.05, WIDE)
    motion = Motion(truth, middle, 30 * MS, MS // 8, 80 * MS)
    assert motion.blur(image, np.full(WIDE[0], middle))[0] == pytest.approx(4.8, rel=0.15)


def star(ps: int, rows: slice = slice(0, 120)) -> Any:
    """36 spokes that turn four times a second, coverage of pixels: one passes every 6.9 ms."""
    y, x = np.indices((120, 160))[:, rows] - np.array([59.3, 80.1])[:, None, None]
    radius = np.hypot(x, y)
    phase = 36 * (np.arctan2(y, x) - 2 * np.pi * 4 * ps / PS)
    soft = np.maximum(radius, 1) / 36  # an edge is a pixel wide
    return 0.5 + 0.4 * np.clip(soft * np.sin(phase), -1, 1) * (radius < 75)


@pytest.mark.parametrize("span", [5.0, 8.192, 16.384, 25.0, 32.768])
def test_a_scene_that_repeats_itself_is_read_at_its_span(span: float) -> None:
    """As the EBAPS films the star: rows 32 us apart, noise as large as what varies. Spans that
    differ by repeats look almost alike; the edge's width is within 5 % all the same."""
    middle = 40 * MS
    motion = Motion(star, middle, 38 * MS, MS // 4, 80 * MS)
    instants = middle + (np.arange(120) - 60) * PS // 31_250
    image = np.zeros((120, 160))
    times = ((np.arange(128) + 0.5) / 128 - 0.5) * span * MS
    for row, instant in enumerate(instants):
        own = slice(row, row + 1)
        image[row] = np.mean([star(int(instant + t), own)[0] for t in times], axis=0)
    image = image + np.random.default_rng(7).normal(0, image.std(), image.shape)
    expected = RAMP * float(motion.speed() or 0) * span * 1e-3
    assert motion.blur(0.98 * image + 0.01, instants)[0] == pytest.approx(expected, rel=0.05)


def test_the_mean_edge_s_speed_is_the_scene_s() -> None:
    """Bars that lean by 0.1: their edges go 1500/sqrt(1.01) pixels a second across themselves."""
    motion = Motion(stripes(1500.0), 40 * MS, 30 * MS, MS // 4, 80 * MS)
    assert motion.speed() == pytest.approx(1500 / np.sqrt(1.01), rel=0.05)


@pytest.mark.parametrize("width", [1.0, 1.5, 2.5, 5.0, 10.0])
@pytest.mark.parametrize(("offset", "angle"), [(0.0, 0.3), (0.3, 0.05), (0.5, 1.0)])
def test_a_blurred_edge_of_known_width_is_read_within_5_percent(
    width: float, offset: float, angle: float
) -> None:
    """An edge that lies anywhere on the pixels, blurred before the pixels sample it, with noise."""
    size, fine = 64, 8
    along = (np.arange(size * fine) + 0.5) / fine - 0.5 - size / 2
    distance = (along[None] - offset) * np.cos(angle) + along[:, None] * np.sin(angle)

    def sampled(plane: Any) -> Any:
        return plane.reshape(size, fine, size, fine).mean(axis=(1, 3))

    truth, image = sampled((distance > 0) * 1.0), sampled(ndtr(distance * EDGE / width))
    image = 5 + 3 * image + np.random.default_rng(8).normal(0, 0.01, image.shape)
    assert still_blur(image, truth) == pytest.approx(width, rel=0.05)


def test_smear_is_taken_off_by_columns() -> None:
    """A bright disc on 512 lit rows, 1 ms: what the pixels smear, the columns' sums take off."""
    pixels = EmccdPixels()
    y, x = np.indices(pixels.shape)
    light = 0.2 + 0.8 * (np.hypot(y - 250, x - 260) < 90)
    seconds, rows = np.full(pixels.shape[0], 1e-3), pixels.shape[0]
    exposed = Exposed(light * 0.05, seconds, np.zeros(rows), 0, 0)
    sharp, smeared = (
        pixels.convert(exposed, 1, kept).astype(float)[8:-8] - pixels.offset
        for kept in (frozenset[str](), frozenset({"smear"}))
    )
    share = pixels.row_shift / 1e-3
    left = without_smear(smeared, share)
    inside = (slice(None), slice(12, -12))
    assert np.abs(smeared - sharp)[inside].max() > 0.2 * sharp.max()
    # Rounding of both, and of 512 values' sum.
    assert np.abs(left - sharp)[inside].max() < 1.5
    assert without_smear(sharp, 0.0) == pytest.approx(sharp)
    with pytest.raises(ValueError, match="share must be 0 to below 1"):
        without_smear(sharp, 1.0)


def test_blur_of_what_stands_still_is_the_gaussian_s() -> None:
    from scipy.ndimage import gaussian_filter

    truth = (np.random.default_rng(3).random((30, 30)) > 0.5).repeat(4, 0).repeat(4, 1) * 1.0
    image = gaussian_filter(truth, 2.0) * 9 + np.random.default_rng(4).normal(0, 0.3, truth.shape)
    assert still_blur(image, truth) == pytest.approx(2.0 * EDGE, rel=0.05)
    assert still_blur(truth, truth) == 0
    assert still_blur(np.random.default_rng(5).normal(0, 1, truth.shape), truth) is None


def test_noise_is_the_spread_over_the_signal_at_grey() -> None:
    """10 % noise on reflectance 0.5, in 16 images of 4000 grey pixels: within 2 %."""
    truth = np.full((100, 100), 0.9)
    truth[:, :40] = 0.5
    rng = np.random.default_rng(6)
    images = [truth * (1 + rng.normal(0, 0.1, truth.shape)) for _ in range(16)]
    everywhere = np.ones(truth.shape, bool)
    assert noise(images, truth, everywhere) == pytest.approx(0.1, rel=0.02)
    assert noise(images[:2], truth, everywhere) is None
    assert noise(images, truth, ~everywhere) is None


def test_light_stands_until_it_is_let_go_and_adds_up_across() -> None:
    """Light of 1 + t/10 ms from the scene's time 0 on; 1 before."""
    light = RunIn(Still(np.full((3, 4), 2.0), Course(((0, 1.0), (10 * MS, 2.0)))))
    begin, end = np.full(3, 100 * MS), np.full(3, 104 * MS)
    assert light.lux_seconds(0, begin, end) == pytest.approx(2.0 * 4e-3, rel=1e-4)
    light.offset = 102 * MS
    # 2 ms of 2 lux, then 2 ms from 2 to 2.4 lux.
    assert light.lux_seconds(1, begin[:2], end[:2]) == pytest.approx(4e-3 + 4.4e-3, rel=1e-4)
    placed = Placed(light, (8, 9), (2, 3))
    whole = placed.lux_seconds(0, np.full(8, 100 * MS), np.full(8, 104 * MS))
    assert whole[2:5, 3:7] == pytest.approx(8.4e-3, rel=1e-4)
    assert whole.sum() == pytest.approx(12 * 8.4e-3, rel=1e-4)
    below = placed.lux_seconds(4, np.full(4, 100 * MS), np.full(4, 104 * MS))
    assert (below == whole[4:]).all()


def test_dynamic_range_is_full_scale_over_the_dark_s_noise() -> None:
    """8 bits: 255.5 DN over 0.39 DN is 56 dB; an EMCCD's ends at the image well at gain 1."""
    assert one_frame(AdaptivePixels((16, 16)), 0.01) == pytest.approx(56.3, abs=0.3)
    chip = EmccdPixels(gain=1.0)
    assert ends(chip, 0.01)[1] * chip.responsivity == pytest.approx(chip.image_well, rel=0.01)
    assert with_controls(AdaptiveComparison(), AdaptivePixels((16, 16))) == pytest.approx(
        56.3 + 20 * np.log10(65_536), abs=0.5
    )


def test_knobs_follow_the_light_and_leave_what_is_given() -> None:
    day, night = 50.0, 3e-4

    def set_ebaps(section: EbapsSection, mean: float, given: frozenset[str]) -> EbapsSection:
        return EbapsComparison().adjust(section, 2 * mean, mean, given)

    def set_emccd(section: EmccdSection, white: float, given: frozenset[str]) -> EmccdSection:
        return EmccdComparison().adjust(section, white, white / 2, given)

    assert set_ebaps(EbapsSection(kind="ebaps"), night, frozenset()).high_voltage == -1500
    assert set_ebaps(EbapsSection(kind="ebaps"), day, frozenset()).high_voltage > -500
    kept = set_ebaps(EbapsSection(kind="ebaps"), day, frozenset({"high_voltage", "exposure"}))
    assert kept.high_voltage == -1500 and kept.exposure == 16.384e-3
    dark, bright = (set_emccd(EmccdSection(kind="emccd"), lux, frozenset()) for lux in (night, day))
    assert dark.exposure == pytest.approx(40.96e-3) and dark.gain > 10
    white = bright.exposure * day * EmccdPixels().responsivity
    assert bright.gain == 1 and 0.78 * 130e3 < white <= 0.8 * 130e3


@pytest.mark.parametrize("white", [5.0, 40.0])
def test_noise_leaves_no_dark_pixel_without_a_pulse(white: float) -> None:
    """At the darkest reflectance every width ends, and its noise is the closed form's."""
    section = PwmSection(kind="pwm", dark_current="0 e/s")  # type: ignore[arg-type]
    chosen = PwmComparison().adjust(section, white, white / 2, frozenset())
    pixels = PulseModel(chosen).pixels
    light, rows = DARKEST * white * chosen.exposure, np.full(64, chosen.exposure)
    exposed = Exposed(np.full((64, 500), light), rows, np.zeros(64), 0, 0)
    values = pixels.convert(exposed, 1, frozenset(pixels.effects))
    assert values.max() < pixels.full
    lux = pixels.lux(values)
    assert float(lux.mean() / lux.std()) == pytest.approx(
        pixels.snr(light, chosen.exposure), rel=0.1
    )


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("nonsense", "one of glass"), ("light-link", "a link"), ("bring-up", "a board"),
    ],
)  # fmt: skip
def test_what_is_no_scene_is_refused(name: str, said: str) -> None:
    with pytest.raises(InputError, match=said):
        load_comparison(name)


@pytest.mark.parametrize(
    "wrong", ["nonsense=1", "scene=1", "ebaps.nonsense=1", "emccd.gain=0.5", "spike.chip=spiketwo"]
)
def test_a_wrong_key_is_refused_in_one_line(wrong: str) -> None:
    with pytest.raises(InputError) as caught:
        load_comparison("star", [wrong])
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(("given", "write"), [("3 ms", "10 ms"), ("3 s", "2 s")])
def test_a_duration_out_of_range_is_refused_with_the_line_to_write(
    given: str, write: str, tmp_path: Path
) -> None:
    comparison = load_comparison("star", [f"duration={given}"])
    with pytest.raises(InputError, match=f"not .*; write --set duration='{write}'$"):
        run_compare(comparison, tmp_path / "out", None, QuietProgress(), 0.0)
    assert not (tmp_path / "out").exists()


def test_scenes_come_from_names_files_and_kinds(tmp_path: Path) -> None:
    named = load_comparison("ebaps-night")
    assert named.spike.scene.illuminance == 3e-3 and named.spike.sensor.lens.f_number == 1.4
    kind = load_comparison("sun-and-stars", ["duration=20 ms"])
    assert kind.spike.duration == 0.02
    plain = load_comparison("target")
    assert plain.spike.scene.kind == "target" and plain.notes
    for made in (named, kind, plain):
        lenses = {i.lens.f_number for i in made.imagers.values() if i.lens is not None}
        assert lenses == {made.spike.sensor.lens.f_number}


@pytest.mark.slow
def test_the_command_films_one_scene_by_all(viform: Callable[..., Any], tmp_path: Path) -> None:
    """A star that turns: the spike camera sees it sharp, long exposures do not."""
    out = tmp_path / "made"
    answer = viform("compare", "star", "--out", str(out), "--json")
    assert answer.code == 0
    document = json.loads(answer.out)
    rows = {row["imager"]: row for row in document["rows"]}
    assert list(rows)[:5] == ["spike-tfi", "spike-tfp", "adaptive-exposure", "ebaps", "emccd"]
    for row in rows.values():
        assert set(FIGURES) <= set(row)
        assert all(set(row[name]) == {"value", "unit"} for name in FIGURES)
        assert abs(row["off"]["value"]) < 0.1

    def of(name: str, figure: str) -> float:
        return float(rows[name][figure]["value"])

    assert of("spike-tfi", "blur") < of("emccd", "blur") < of("adaptive-exposure", "blur")
    assert of("adaptive-exposure", "blur") < of("ebaps", "blur")
    assert of("spike-tfi", "data_rate") == SHAPE[0] * SHAPE[1] * 40e3
    assert of("emccd", "noise") < of("adaptive-exposure", "noise") < of("spike-tfi", "noise")
    assert of("spike-tfp", "psnr") > of("emccd", "psnr") > of("ebaps", "psnr")
    # The noise of the dark is that of the closed form; the smear is no signal of the EMCCD.
    dark = {name: points[0] for name, points in document["snr"].items() if points}
    assert dark["pwm"]["measured"] == pytest.approx(dark["pwm"]["formula"], rel=0.1)
    assert all(p["measured"] < 1.25 * p["formula"] for p in document["snr"]["emccd"])
    for name in document["files"]:
        assert (out / name).exists()
    assert json.loads((out / "compare.json").read_text())["rows"] == document["rows"]


def test_a_folder_that_is_not_empty_is_refused(viform: Callable[..., Any], tmp_path: Path) -> None:
    (tmp_path / "there").write_text("")
    answer = viform("compare", "star", "--out", str(tmp_path))
    assert answer.code == 2 and answer.err.count("\n") == 1
    late = viform("compare", "star", "--set", "duration=5 s", "--out", str(tmp_path / "new"))
    assert late.code == 2 and not (tmp_path / "new").exists()
