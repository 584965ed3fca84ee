"""Probes of a display against closed forms: what is filmed, shown, and told of it."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from cosim import Clock, Viform
from cosim.spikes.viform import pack_planes
from display import SpikePanel
from display.drives import DRIVES
from display.panels.panel import FramePanel, Projector
from display.probes import metrics
from display.probes.blur import SPEED, frame_blur, retina, spike_blur
from display.probes.flicker import frame_flicker, spike_flicker, spike_pst_lm
from display.probes.latency import SIDE, frame_latency, spike_latency
from display.probes.metrics import display_metrics, probe_display
from display.probes.setup import edge_light, phased_light, steady_light
from display.probes.waveform import every_drive, panel_light
from display.quality.edges import blur_edge_width
from display.render.golden import GoldenRenderer
from scenarios.assemble.source.latched.feed import SpikeProbeCamera
from sensor import CHIPS, EFFECTS, CameraSetting, SpikeCamera
from sensor.latched.sampling import RowTiming

CLOCK = Clock(40_000)
CYCLE = 25.0
"""Microseconds."""
QUIET = (EFFECTS["random initial charge"], EFFECTS["residual carried"])
ROWS = CYCLE * (SIDE - 1) / SIDE / 2
"""Mean wait of a row, microseconds."""
NOISY_ROWS = RowTiming(jitter=0.2, wander=0.02, centre=0.05, rows=8)
FRAMES = tuple(FramePanel(Clock(hz)) for hz in (60, 120, 240, 1000))


def setting(**changes):
    noiseless = {"effects": QUIET, "threshold": 1e5}
    base = CameraSetting(CHIPS["spiketwo"], CLOCK, 1000.0, 1)
    return replace(base, **(noiseless | changes))


def panel(**changes):
    base = SpikePanel((1000, 1000), CLOCK, 0.6, transport=1_000_000)
    return replace(base, **changes)


@pytest.fixture(scope="module")
def probe(device):
    return SpikeProbeCamera(setting(), device)


def told(rows, drive, way="rise"):
    (found,) = (row for row in rows if (row.drive, row.way) == (drive, way))
    return found


@pytest.mark.parametrize("drive", DRIVES)
@pytest.mark.parametrize(("pulse", "rise", "decay"), [(1, 0, 0), (0.4, 0, 0), (0.4, 9e-6, 7e-5)])
def test_light_is_that_of_the_golden_model(drive, pulse, rise, decay):
    rng = np.random.default_rng(4)
    planes = rng.random((70, 3, 4)) < np.linspace(0, 1, 12).reshape(3, 4)
    own = panel(shape=(3, 4), drive=drive, pulse=pulse, rise=rise, decay=decay)
    golden = GoldenRenderer(own, 1, 0)
    golden.step(pack_planes(planes), 70, None)
    stream = Viform.from_planes(planes, CLOCK)
    light = panel_light(stream, own, drive)
    np.testing.assert_allclose(light.reshape(70, 3, 4), golden.light, rtol=1e-9, atol=1e-12)
    rows = np.arange(3).repeat(4).reshape(3, 4)
    coarse = every_drive(stream, own, 8, rows)[drive]
    wanted = golden.light[:64].reshape(8, 8, 3, 4).mean(axis=(1, 3))
    np.testing.assert_allclose(coarse, wanted, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("drive", DRIVES)
def test_light_after_long_waits_is_that_of_the_golden_model(drive):
    planes = np.zeros((9000, 1, 3), bool)
    planes[[5, 14, 22, 1300, 6500], 0, 0] = True  # waits of 8 and 7, then beyond all tables
    planes[::9, 0, 1] = planes[4090::4, 0, 2] = True
    golden = GoldenRenderer(panel(shape=(1, 3), drive=drive), 1, 0)
    golden.step(pack_planes(planes), 9000, None)
    stream = Viform.from_planes(planes, CLOCK)
    own = panel(shape=(1, 3), drive=drive)
    light = panel_light(stream, own, drive)
    np.testing.assert_allclose(light, golden.light[:, 0], rtol=1e-12, atol=1e-15)
    summed = golden.light[:8988, 0].reshape(-1, 7, 3).mean(axis=1)
    coarse = panel_light(stream, own, drive, 7)[: len(summed)]
    np.testing.assert_allclose(coarse, summed, rtol=1e-12)


def test_an_edge_covers_every_pixel_as_it_passes():
    light = edge_light((2, 30), 1.0, 5.0, SPEED, CLOCK, 200)  # 20 pixels in 200 cycles
    cover = np.clip(20 - np.arange(30), 0, None)
    ramped = np.where(np.arange(30) < 20, cover - 0.5, 0.0)  # in pixels' crossing times
    wanted = CLOCK.edge(200) / 1e12 + 4 * ramped / SPEED
    np.testing.assert_allclose(light.integral(0, CLOCK.edge(200))[1], wanted, rtol=1e-6)


def test_every_column_jumps_at_its_own_instant():
    at = np.array([100, 130, 170])
    light = phased_light((2, 3), 2.0, 7.0, at, 1000)
    exposed = light.integral(0, 1000)[0] * 1e12
    np.testing.assert_allclose(exposed, 2 * at + 7 * (1000 - at))


def bright_law(cycles):
    """Distribution of the interval at 1.5 thresholds a cycle: what is left of the cycle, w, will
    do if the charge there was reaches 1 - 1.5 w; the next cycle always does."""
    w = np.clip(cycles, 0, 1)
    first = np.where(w < 2 / 3, 0.75 * w**2, w - 1 / 3)
    later = np.clip(cycles - 1, 0, 1)
    return first + later - np.where(later < 2 / 3, 0.75 * later**2, later - 1 / 3)


def test_bright_light_takes_the_interval_of_its_law(probe):
    rows = spike_latency(probe, panel(), (1.5,), 3)
    found = told(rows, "impulse")
    assert found.lost == 0
    assert found.total.median <= 50
    for share, us in ((0.05, found.parts[0].low), (0.5, found.parts[0].median)):
        # A quantile of 4096 pixels, five deviations of the share.
        spread = 5 * math.sqrt(share * (1 - share) / SIDE**2)
        assert bright_law(us / CYCLE) == pytest.approx(share, abs=spread)
    assert found.parts[0].mean == pytest.approx(CYCLE * 5 / 6, abs=5 * 0.5 * CYCLE / SIDE)
    assert found.parts[1].mean == pytest.approx(ROWS)
    assert [found.parts[2].median, found.parts[3].median] == pytest.approx([1, 0])
    for drive in ("hold", "causal"):  # wait for a second spike, which the next cycle has
        assert told(rows, drive).total.mean == pytest.approx(found.total.mean + CYCLE)


def test_dim_light_waits_for_a_uniform_interval_and_the_latch(probe):
    rate = 0.05
    interval = told(spike_latency(probe, panel(), (rate,), 5), "impulse").parts[0]
    law = stats.trapezoid(1 / 21, 20 / 21, 0, 21 * CYCLE)  # a uniform of 20 and one of 1
    for share, us in ((0.05, interval.low), (0.5, interval.median), (0.95, interval.high)):
        assert law.cdf(us) == pytest.approx(share, abs=5 * math.sqrt(share * (1 - share)) / SIDE)
    assert interval.mean == pytest.approx(law.mean(), abs=5 * law.std() / SIDE)


def test_intervals_held_come_with_the_second_spike_and_fade_after_two(probe):
    rows = spike_latency(probe, panel(), (0.25,), 6)
    hold = told(rows, "hold")
    assert [hold.parts[3].low, hold.parts[3].high] == pytest.approx([4 * CYCLE] * 2)
    assert told(rows, "hold", "fall").lost == 1  # no spike says that there is no light
    # Shown until the plane of age 8, where it is half, less the balance of the dark start that was
    # repaid since. The last full pixel was full up to 4 cycles ago and latched up to one later.
    fading = told(rows, "causal", "fall")
    wanted = (8 - 2 + 0.5) * CYCLE + ROWS + 1
    assert fading.total.mean == pytest.approx(wanted, abs=5 * math.sqrt(17 / 12) * CYCLE / SIDE)
    assert fading.lost == 0


@pytest.mark.parametrize(
    ("chip", "display"),
    [
        ({"effects": tuple(EFFECTS.values()), "threshold": 1000.0}, {}),
        ({"row_skew": 1.0}, {}),
        ({"comparator_delay": 5e-6, "row_skew": 0.3}, {"pulse": 0.25, "rise": 3e-6, "decay": 2e-6}),
        ({}, {"rise": 2e-5, "decay": 1e-4, "row_scan": 0.0, "transport": 7_000_000}),
    ],
)
def test_the_parts_add_up(device, chip, display):
    for row in spike_latency(
        SpikeProbeCamera(setting(**chip), device), panel(**display), (0.3, 1.5), 7
    ):
        if row.lost < 1:
            assert sum(part.mean for part in row.parts) == pytest.approx(row.total.mean)
            assert row.parts[0].low > 0 and row.parts[3].low >= 0
        if chip.get("row_skew") == 1.0 and row.lost < 1:
            assert [row.parts[1].low, row.parts[1].high] == pytest.approx([0, 0], abs=1e-6)


def test_an_emitter_adds_ln_2_of_its_time(probe):
    for drive in DRIVES:
        fast, slow = (
            told(spike_latency(probe, panel(rise=rise), (1.5,), 3), drive) for rise in (0.0, 1e-5)
        )
        assert slow.total.mean - fast.total.mean == pytest.approx(10 * math.log(2), abs=1e-3)


def test_dead_pixels_are_lost(device):
    from sensor.device.pattern import DevicePattern

    dead = setting(pattern=DevicePattern(dead=0.25))
    lost = told(spike_latency(SpikeProbeCamera(dead, device), panel(), (1.5,), 3), "impulse").lost
    assert lost == pytest.approx(0.25, abs=5 * math.sqrt(0.25 * 0.75) / SIDE)


def test_frames_wait_for_the_next_frame_on_average_half_of_one():
    (up, down) = frame_latency(FramePanel(Clock(60)), 0.6, (0.18,))
    for row in (up, down):
        assert row.total.median == pytest.approx(1e6 / 120)
        assert row.total.high == pytest.approx(0.95e6 / 60, rel=1e-3)
    slow = FramePanel(Clock(120), response=2e-3, latency=3e-3)
    for row in frame_latency(slow, 0.6, (0.18,)):
        assert row.total.median == pytest.approx(1e6 / 240 + 3000 + 2000 * math.log(2))
    flash = FramePanel(Clock(100), persistence=0.1, response=5e-3)
    up, down = frame_latency(flash, 0.6, (0.18,))
    # On at 1 - exp(-t / 5 ms) = .05; off after ln 20 times 5 ms, in the second flash or before it.
    assert up.parts[3].median == pytest.approx(-5000 * math.log(0.95))
    assert down.parts[3].median == pytest.approx(11_000)


@pytest.mark.parametrize("level", [1.0, 0.5, 0.3])
def test_the_projector_waits_for_a_plane_that_is_on(level):
    up, down = frame_latency(Projector(Clock(16_000)), 0.6, (0.6 * level,))
    plane = 62.5
    # An error grows by the level a plane to one half: uniform over 1 / level planes, rounded up.
    wanted = 80 + plane * ((1 / level + 1) / 2 - 1 + 0.5)
    assert up.total.mean == pytest.approx(wanted, rel=0.02)
    assert down.total.mean == pytest.approx(80 + plane / 2)


def drawn_out(at, side, way):
    """Light of the column 30, whose middle emits, on an eye that moves by `way` from 0."""
    low, high = 30.5 - side / 2, 30.5 + side / 2
    return np.clip(np.minimum(at + way, high) - np.maximum(at, low), 0, None) / way / side


@pytest.mark.parametrize("spans", [1, 3, 400])
@pytest.mark.parametrize("side", [1.0, 0.5, 1e-3])
def test_a_still_pattern_on_a_moving_eye_is_drawn_out(spans, side):
    """The mean over an even motion in closed form, in any number of spans."""
    light, way = np.zeros((spans, 60)), 10.0
    light[:, 30] = 1.0
    at = np.arange(10, 49, 0.3) + 0.01
    begins, length = np.arange(spans) / spans * way / SPEED, way / spans / SPEED
    seen = retina(light, begins, length, at, side)
    np.testing.assert_allclose(seen, drawn_out(at, side, way), atol=1e-9)


def test_spans_are_seen_in_their_own_light():
    light = np.random.default_rng(1).random((3, 60))
    begins, at = np.array([0.0, 1.5e-3, 4e-3]), np.arange(10, 39, 0.5)
    each = [retina(light[[n]], begins[[n]], 1e-4, at) for n in range(3)]
    np.testing.assert_allclose(retina(light, begins, 1e-4, at), np.mean(each, axis=0))


@pytest.mark.parametrize(("one", "bet"), [(one, one.rate.hz) for one in FRAMES])
def test_holds_have_the_blur_of_theory(one, bet):
    (row,) = frame_blur(one, 0.6, ((0.0, 0.18),))
    wide = SPEED / bet
    x = np.linspace(-wide - 3, wide + 3, 8001)
    wanted = blur_edge_width(x, drawn(x, wide), 0.0, 1.0)
    assert row.width == pytest.approx(wanted, rel=0.02)
    if bet <= 120:  # the pixels' own size no longer counts
        assert row.bet == pytest.approx(0.8 / bet, rel=0.02)
        assert row.ebet == pytest.approx(1 / bet, rel=0.02)


def drawn(x, *widths):
    """A step seen through the panel's and the sensor's pixel and boxes of these widths."""
    fine = x[1] - x[0]
    profile = (x >= 0).astype(float)
    for width in (1.0, 1.0, *widths):
        box = np.ones(max(round(width / fine), 1))
        half = len(box) // 2
        padded = np.pad(profile, (len(box) - 1 - half, half), mode="edge")
        profile = np.convolve(padded, box / len(box), mode="valid")
    return profile


@pytest.mark.parametrize("rate", [1, 24, 30, 75, 144])
def test_any_frame_rate_has_the_blur_of_its_hold(rate):
    (row,) = frame_blur(FramePanel(Clock(rate)), 0.6, ((0.0, 0.18),))
    assert row.ebet == pytest.approx(1 / rate, rel=0.02)


@pytest.mark.parametrize(("rate", "response"), [(60, 10e-3), (60, 50e-3), (120, 5e-3)])
def test_slow_pixels_have_the_blur_of_a_hold_and_an_exponential(rate, response):
    time = np.arange(0, 1 / rate + 12 * response, 2e-5)
    box = np.clip(time * rate, 0, 1)  # the edge through the hold
    kernel = np.exp(-time / response)
    seen = np.convolve(box, kernel / kernel.sum())[: len(time)]
    low, high = (np.interp(level, seen, time) for level in (0.1, 0.9))
    (row,) = frame_blur(FramePanel(Clock(rate), response=response), 0.6, ((0.0, 0.18),))
    assert row.bet == pytest.approx(high - low, rel=0.02)


def test_slow_emitters_settle_while_they_are_watched(probe):
    slow = panel(rise=2e-3, decay=2e-3)
    for row in spike_latency(probe, slow, (1.5,), 3):
        if row.way == "rise":
            assert row.lost == 0 and row.total.median > 2e3 * math.log(2)
    assert spike_blur(probe, slow, (0.0, 0.18), 8)[0].ebet == pytest.approx(
        2e-3 * math.log(9) / 0.8, rel=0.05
    )


def test_places_of_the_retina_that_leave_the_columns_are_refused():
    for at in (np.array([-0.1]), np.array([5.0])):
        with pytest.raises(ValueError, match="must stay within 5 columns"):
            retina(np.ones((1, 5)), np.zeros(1), 1e-9, at)


def test_a_pixel_that_fills_less_emits_from_its_middle(probe):
    at = np.array([2.1, 2.3, 2.5, 2.7, 2.9, 3.5])
    light = np.array([[0.0, 0.0, 1.0, 0.0, 0.0]])
    np.testing.assert_allclose(
        retina(light, np.zeros(1), 1e-9, at, 0.5), [0, 2, 2, 2, 0, 0], atol=1e-6
    )
    (row, *_) = spike_blur(probe, panel(fill=0.25), (0.0, 0.18), 8)
    # A sensor's pixel of 1 and half a panel's one: a trapezoid of sides 1.5 and 0.5, from its 10 %.
    assert row.width == pytest.approx(2 * (0.75 - math.sqrt(0.1)), rel=0.03)


def test_a_strobe_of_half_a_millisecond_has_its_blur():
    (row,) = frame_blur(FramePanel(Clock(60), persistence=0.03), 0.6, ((0.0, 0.18),))
    x = np.linspace(-6, 6, 8001)
    wanted = blur_edge_width(x, drawn(x, SPEED * 0.5e-3), 0.0, 1.0)
    assert row.width == pytest.approx(wanted, rel=0.02)


def test_impulses_blur_no_more_than_the_pixels_and_ten_times_less_than_120_hz(probe):
    (held,) = frame_blur(FRAMES[1], 0.6, ((0.0, 0.18),))
    rows = {row.drive: row for row in spike_blur(probe, panel(), (0.0, 0.18), 8)}
    x = np.linspace(-3, 3, 6001)
    pixels = blur_edge_width(x, drawn(x, SPEED / 40e3), 0.0, 1.0)
    # Of 2880 spikes at a place: 2 % of the level, where a tenth of it changes in 0.1 pixels.
    assert rows["impulse"].width == pytest.approx(pixels, rel=0.1)
    assert all(row.ebet < held.ebet / 10 for row in rows.values())


def test_held_light_never_goes_dark_and_causal_light_fades_as_one_over_time(probe):
    rows = {row.drive: row for row in spike_blur(probe, panel(), (0.25, 0.0), 9)}
    assert math.isnan(rows["hold"].ebet) and math.isnan(rows["hold"].cmr)
    # 90 % at 4.4 cycles after the last spike, 10 % at 40: 0.1 pixels each.
    assert rows["causal"].width == pytest.approx(3.6, rel=0.2)


def flicker_of(rows, drive, area):
    (found,) = (row.figures for row in rows if (row.drive, row.area) == (drive, area))
    return found


def test_steady_light_that_fires_every_fourth_cycle(probe):
    rows = spike_flicker(probe, panel(), (0.25,), 60.0, 2)
    pulses = flicker_of(rows, "impulse", "pixel")
    assert (pulses.percent, pulses.index) == pytest.approx((100, 0.75))
    assert pulses.ieee.frequency == pytest.approx(10_000) and pulses.ieee.risk == "no effect"
    assert pulses.svm < 1e-3 and pulses.visibility < 1e-3
    for drive in ("hold", "causal"):
        for area in ("patch", "pixel"):
            held = flicker_of(rows, drive, area)
            # The balance of the dark start is nearly repaid.
            assert held.mean == pytest.approx(0.25, rel=1e-4)
            assert held.percent == pytest.approx(0, abs=0.1)
    assert flicker_of(rows, "impulse", "patch").mean == pytest.approx(0.25, abs=1e-4)


def test_white_has_its_own_light_in_all_drives(probe):
    # At 0.6 a cycle intervals are 2, 2, 1 in turn; 1 / tau, held for the next, has a mean of 0.7.
    rows = spike_flicker(probe, panel(), (0.6,), 60.0, 2)
    for drive in DRIVES:
        assert flicker_of(rows, drive, "patch").mean == pytest.approx(0.6, rel=1e-3)


def test_frames_hold_still_and_strobes_do_not():
    for row in (row.figures for row in frame_flicker(FRAMES[0], 0.6, 300.0, (0.18,), 60.0)):
        assert (row.percent, row.index, row.svm, row.visibility) == (0, pytest.approx(0), 0, 0)
    strobe = FramePanel(Clock(100), persistence=0.25)
    row = frame_flicker(strobe, 0.6, 300.0, (0.18,), 60.0)[0].figures
    assert (row.percent, row.index) == pytest.approx((100, 0.75), rel=1e-3)
    assert row.ieee.frequency == 100 and row.ieee.risk == "high risk"
    # Of a pulse of a quarter: 2 sin(pi / 4) / (pi / 4).
    assert row.ieee.modulation == pytest.approx(
        100 * 2 * math.sin(math.pi / 4) / (math.pi / 4), rel=1e-3
    )


def test_the_projector_flickers_at_its_own_rate_times_the_level():
    rows = frame_flicker(Projector(Clock(16_000)), 0.6, 300.0, (0.06, 0.6), 60.0)
    pixel, full = rows[1].figures, rows[3].figures
    assert pixel.mean == pytest.approx(0.06, rel=1e-2)
    assert (pixel.percent, pixel.ieee.frequency) == (100, pytest.approx(1600))
    assert full.percent == 0 and full.mean == pytest.approx(0.6)


def test_the_whole_table_has_its_metrics(device):
    own = SpikeProbeCamera(setting(effects=tuple(EFFECTS.values()), threshold=1000.0), device)
    beside = [FRAMES[1], Projector(Clock(16_000))]
    probes = probe_display(own, panel(), beside, 1, rates=(0.18, 1.5), edges=((0.0, 0.18),))
    metrics = display_metrics(probes)
    assert 0 < metrics["latency_bright_us"].value <= 50
    assert metrics["latency_bright_us_hold"].value > metrics["latency_bright_us"].value
    for name in (
        "latency_grey_us_120hz", "ebet_ms_120hz", "ebet_ms_projector", "flicker_svm_spike",
        "flicker_percent_spike", "latency_bright_us_causal",
    ):  # fmt: skip
        assert metrics[name].value is not None, name
    assert metrics["latency_grey_fall_us_hold"].value is None
    assert metrics["blur_120hz_over_spike"].value >= 10
    assert metrics["ebet_ms_spike"] == metrics["ebet_ms_causal"]
    again = probe_display(own, panel(), [], 1, rates=(0.18,), edges=())
    assert again.latency == probes.latency[: len(again.latency)] and len(again.latency) == 6


def test_probes_of_the_same_camera_and_display_are_kept_between_runs(tmp_path, monkeypatch):
    """All that they depend on tells them apart, and each number comes back as it was."""
    monkeypatch.setenv("VIFORM_CACHE", str(tmp_path))
    made = []

    def probe_display(camera, panel, references, seed, **options):
        made.append((camera, panel, references, seed))
        light = panel.white_rate
        return metrics.Probes(
            panel.drive, tuple(frame_latency(FRAMES[0], light, [0.18, 1 / 3])),
            tuple(frame_blur(FRAMES[0], light, [(0.0, 0.18)])),
            tuple(frame_flicker(FRAMES[1], light, 300.0, [0.18, 0.0], 60.0)), 0.1 + seed,
        )  # fmt: skip

    monkeypatch.setattr(metrics, "probe_display", probe_display)

    def found(camera, shown, seed=1):
        return metrics.kept_probes(
            camera, shown, FRAMES[:2], seed, per_degree=60.0, pst_lm=True,
            told=lambda done, total: None,
        )  # fmt: skip

    noisy = setting(effects=tuple(EFFECTS.values()), row_timing=NOISY_ROWS)
    quiet = SpikeProbeCamera(setting(), None)
    for camera in (quiet, SpikeProbeCamera(noisy, None)):
        assert repr(found(camera, panel())) == repr(found(camera, panel()))
    assert len(made) == 2 and "nan" in repr(found(quiet, panel()))
    found(quiet, panel(decay=1e-5))
    found(quiet, panel(), seed=2)
    assert len(made) == 4
    found(replace(quiet, setting=setting(threshold=999.0)), panel())
    assert len(made) == 5


def test_a_recording_in_parts_has_the_same_bits_and_looks_at_few_pieces_of_light(monkeypatch):
    """A drift cuts light into pieces, and noisy instants look through all of them in each cycle: a
    minute in one block took hours."""
    noisy = setting(effects=tuple(EFFECTS.values()), drift=8e-4, row_timing=NOISY_ROWS)
    probe = SpikeProbeCamera(noisy, None)
    light = steady_light((4, 4), probe.lux(0.18), CLOCK.edge(402))
    whole = probe.film(light, 400, (64, 4), 1, (0, 4))
    lengths, step = [], SpikeCamera.step

    def watched(camera, light, block):
        lengths.append(block.cycles)
        return step(camera, light, block)

    monkeypatch.setattr(SpikeCamera, "step", watched)
    monkeypatch.setattr("scenarios.assemble.source.latched.feed.PART", 128)
    parts = probe.film(light, 400, (64, 4), 1, (0, 4))
    np.testing.assert_array_equal(parts.words, whole.words)
    assert lengths == [128, 128, 128, 16]


def test_a_recording_of_a_minute_has_no_noisy_instants(monkeypatch):
    monkeypatch.setattr("scenarios.assemble.source.latched.feed.NOISY", 99)
    probe = SpikeProbeCamera(setting(row_timing=NOISY_ROWS), None)
    light = steady_light((4, 4), probe.lux(0.18), CLOCK.edge(102))
    steady = SpikeProbeCamera(setting(), None)
    noisy, still = (each.film(light, 99, (64, 4), 1, (0, 4)).words for each in (probe, steady))
    assert (noisy != still).any()
    noisy, still = (each.film(light, 100, (64, 4), 1, (0, 4)).words for each in (probe, steady))
    np.testing.assert_array_equal(noisy, still)


class _Fast:
    """A camera of 100 MHz that nobody may record with."""

    clock, height, seed = Clock(10**8), 1000, 1

    def spikes(self, rate):
        return 0.0

    def lux(self, rate):
        return rate


def test_a_probe_that_needs_gigabytes_has_no_figure():
    fast = panel(clock=_Fast.clock)
    flicker = spike_flicker(_Fast(), fast, (0.18,), 60.0, 1)
    assert len(flicker) == 2 * len(DRIVES) and all(math.isnan(row.figures.svm) for row in flicker)
    edges = spike_blur(_Fast(), fast, (0.0, 0.18), 1)
    assert len(edges) == len(DRIVES) and all(math.isnan(row.bet) for row in edges)
    steps = spike_latency(_Fast(), replace(fast, decay=1e-2), (0.18,), 1)
    assert len(steps) == 2 * len(DRIVES) and all(math.isnan(row.total.median) for row in steps)


@pytest.mark.slow
def test_pst_lm_of_noise_is_small_and_of_a_patch(device):
    own = SpikeProbeCamera(setting(effects=tuple(EFFECTS.values()), threshold=1000.0), device)
    assert 0 < spike_pst_lm(own, panel(), 0.18, "causal", 1) < 0.2


def test_light_is_counted_in_thresholds_a_cycle():
    own = setting()
    assert own.rate(SpikeProbeCamera(own, None).lux(0.18)) == pytest.approx(0.18)


class _Dark(_Fast):
    """A camera that sees nothing."""

    height = 8

    def __init__(self, clock):
        self.clock = clock

    def film(self, light, cycles, shape, seed, rows=None):
        words = np.zeros((-(-cycles // 32), rows[1] - rows[0], shape[1]), np.uint32)
        return Viform(words, cycles, self.clock)


@pytest.mark.parametrize("hz", [100.0, 170.5, 197.25, 551.34, 890.63])
@pytest.mark.parametrize("edge", [(0.0, 0.18), (0.0, 1.5)])
def test_the_eye_of_a_slow_panel_stays_on_the_columns(hz, edge):
    clock = Clock.from_hz(hz)
    assert len(spike_blur(_Dark(clock), panel(clock=clock), edge, 1)) == len(DRIVES)
