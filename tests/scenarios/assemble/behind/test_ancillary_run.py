"""What only a chip can say, at the far end of its chain: register writes, charges below threshold,
and rejected pixels, on a display, behind a link, and on a board.

Each is run tiny, and compared with a closed form of its light: that of the scene whatever is
written, that of charges below one spike, and none of rejected pixels.
"""

import time

import numpy as np
import pytest

import viform
from cosim import InputError
from cosim.files import open_stream
from cosim.run.machine import Options
from cosim.run.shown import SilentProgress
from cosim.spikes.viform import unpack_planes, words_for
from display.chain.display import SPIKE
from display.references.stage import TRUTH
from scenarios.assemble.behind.link import judged, stream_link
from scenarios.assemble.behind.screen import Screen
from scenarios.assemble.schema.messages import validate
from scenarios.cli.entry import _main
from scenarios.run import run_scenario

LINK = {
    "link": {
        "panel": {"width": 192, "height": 192},
        "modem": {"cell": 2, "ticks": 2, "line": "8b10b", "parity": 16},
        "sensor": {"chip": "spikeone", "threshold": "1000 e", "reset": "hard"},
    },
    "code": {"cycles": 64, "buffer": "2 ms"},
}
DISPLAY = {
    "display": {
        "beside": [], "projector": "none", "renderer": "numpy", "observer": "camera",
        "exposure": "2 ms",
    }
}  # fmt: skip
BOARD = {"display": {"sink": "serial:virtual", "fit": "nearest"}}
AT = [90, 190, 350]
"""Middles of the images, of 80 cycles each: in the three phases of the writes."""
CYCLES = 80
WRITES = [
    {"cycle": 130, "threshold_level": 8}, {"cycle": 255, "threshold_level": 4, "window": [8, 24]},
]  # fmt: skip
BRIGHT, DIM = 0.2, 0.02
SAYS = {
    "nothing": (BRIGHT, {}),
    "writes": (BRIGHT, {"writes": WRITES}),
    "charges": (DIM, {"sub_threshold": {"limit": "1 ms", "levels": 200}}),
    "dark": (BRIGHT, {"dark_limit": "0.4 ms"}),
    "charges, dark": (
        DIM,
        {"sub_threshold": {"limit": "1 ms", "levels": 200}, "dark_limit": "3 ms"},
    ),
}
"""Spikes a cycle of white, and keys of the sensor, by what the chip says."""


def data_of(says, sink, **more):
    white, keys = SAYS[says]
    sensor = {
        "width": 32, "height": 24, "threshold": "1000 e", "clock": "40 kHz",
        "lens": {"white_rate": white},
    }  # fmt: skip
    return {
        "title": f"{says}", "duration": "10 ms", "tolerance": 0.01,
        "scene": {"kind": "target", "chart": "steps", "illuminance": "700 lux"},
        "sensor": sensor | keys, "image": {"at": AT, "window": 21}, **sink, **more,
    }  # fmt: skip


@pytest.fixture(autouse=True)
def _quick(monkeypatch):
    monkeypatch.setattr(Screen, "_probes", lambda self, progress: None)
    monkeypatch.setattr(judged, "_watched", lambda link, watch: [])
    monkeypatch.setattr(stream_link, "check_plan", lambda link, progress: (link, []))


def run(data, out):
    kept = []
    done = run_scenario(
        "said", validate(data), out, options=Options("numba"), progress=SilentProgress(),
        began=time.perf_counter(), report=lambda machine, run: kept.append(machine) or [],
    )  # fmt: skip
    metrics = {name: metric.value for name, metric in done.result.metrics.items()}
    return done.result, metrics, kept[0]


def planes(folder, name="stream.zarr"):
    """(T, H, W) of a stream in the folder of a run."""
    stream = open_stream(folder / name)
    return unpack_planes(stream.read_words(0, words_for(stream.cycles)), 0, stream.cycles)


def seen(machine):
    """Images of the camera of the spike display and of the true light, (3, H, W), white = 1."""
    images = machine.behind.screen.chain.images()
    return images[SPIKE]["camera"], images[TRUTH]["camera"]


@pytest.mark.parametrize("drive", ["impulse", "hold", "causal"])
def test_written_thresholds_leave_the_light_as_it_is(tmp_path, drive):
    """Light is rate times threshold: at half and a quarter of the threshold, pixels fire twice and
    four times as often, with packets of as much less."""
    display = {"display": DISPLAY["display"] | {"drive": drive}}
    result, metrics, machine = run(data_of("writes", display), tmp_path / "a")
    assert result.outcome == "ok" and result.error.value < 0.01
    shown, true = seen(machine)
    packet = 1 / (CYCLES * BRIGHT)  # of the nominal threshold, in an image of white = 1
    for image, truth, size in zip(shown[:2], true[:2], (1, 0.5), strict=True):
        assert np.abs(image - truth).max() < 2 * size * packet
        # In the first image some pixels are dark before their second spike.
        assert image.mean() == pytest.approx(truth.mean(), rel=0.06 if size == 1 else 0.02)
    inside = slice(8, 24)
    assert shown[2, inside].mean() == pytest.approx(true[2, inside].mean(), rel=0.02)
    assert np.abs(shown[2, inside] - true[2, inside]).max() < packet
    assert np.all(shown[2, :8] == 0)
    assert metrics["total_light"] == pytest.approx(1, abs=0.06)
    # Spikes of one size, as without the writes, would show twice and four times the light.
    fired = planes(tmp_path / "a")
    of_spikes = fired[150:230].mean() / fired[50:130].mean()
    assert of_spikes == pytest.approx(2, rel=0.05)


@pytest.mark.parametrize("drive", ["impulse", "causal"])
def test_charges_are_seen_below_one_spike(tmp_path, drive):
    """Most pixels fire less than once in 40 cycles. With their charges the image of 80 cycles has
    the light of the scene; from spikes alone it is noise of whole packets."""
    display = {"display": DISPLAY["display"] | {"drive": drive}}
    result, metrics, machine = run(data_of("charges", display), tmp_path / "a")
    data = data_of("charges", display)
    del data["sensor"]["sub_threshold"]
    _, plain, without = run(data, tmp_path / "b")
    shown, true = seen(machine)
    alone, _ = seen(without)
    error, before = (float(np.sqrt(np.mean((x - true) ** 2))) for x in (shown, alone))
    assert result.outcome == "ok" and error < 0.7 * before
    # Pixels that never fire: the light is the mean of levels, which is that of the scene.
    fired = planes(tmp_path / "a")
    never = ~fired[:230].any(axis=0)
    assert never.sum() > 10 and np.all(alone[1][never] == 0)
    assert shown[1][never].mean() == pytest.approx(true[1][never].mean(), rel=0.15)
    assert metrics["psnr_spike"] > plain["psnr_spike"]
    assert np.array_equal(fired, planes(tmp_path / "b"))


@pytest.mark.parametrize("drive", ["impulse", "hold", "causal"])
def test_rejected_pixels_are_exactly_dark(tmp_path, drive):
    """Intervals of 16 cycles or more are dark: pixels below 1/17 spikes a cycle have no light at
    all, those above 1/14 have theirs."""
    display = {"display": DISPLAY["display"] | {"drive": drive}}
    result, metrics, machine = run(data_of("dark", display), tmp_path / "a")
    shown, true = seen(machine)
    dim, bright = true[1] * BRIGHT < 1 / 20, true[1] * BRIGHT > 1 / 13
    assert dim.sum() > 50 and bright.sum() > 50
    assert np.all(shown[:, dim] == 0)
    assert np.abs(shown[:, bright] - true[:, bright]).max() < 2.5 / (CYCLES * BRIGHT)
    assert metrics["dark_spikes_rejected"] > 0 and "shown.zarr" in result.files
    raw, kept = (planes(tmp_path / "a", name) for name in ("stream.zarr", "shown.zarr"))
    # Nobody knows how long the interval before the first spike is.
    assert not kept[16:, dim].any() and raw[:, dim].any() and not (kept & ~raw).any()
    assert np.array_equal(kept[:, bright], raw[:, bright])


@pytest.mark.parametrize("says", SAYS)
def test_what_is_said_crosses_a_link(tmp_path, says):
    """The link carries everything: the far display shows the same light, to the last bit, as one
    without a link, and a board behind it has the same planes."""
    _, near, here = run(data_of(says, DISPLAY), tmp_path / "a")
    result, far, there = run(data_of(says, DISPLAY | LINK), tmp_path / "b")
    assert far["packets_dropped"] == far["frames_lost"] == 0 and result.outcome == "ok"
    sent = planes(tmp_path / "b", "shown.zarr" if "dark" in says else "stream.zarr")
    assert np.array_equal(sent, planes(tmp_path / "b", "received.zarr"))
    assert far["dropped_spikes"] == far["added_spikes"] == 0
    np.testing.assert_array_equal(seen(there)[0], seen(here)[0])
    assert far["psnr_spike"] == near["psnr_spike"] and far["total_light"] == near["total_light"]
    assert far["psnr_through_link"] == far["psnr_direct"] > (6 if "charges" in says else 15)
    said = says not in ("nothing", "dark")
    assert ("ancillary_bytes" in far) == said
    assert not said or far["ancillary_bytes"] > 0 == far["ancillary_dropped"]
    if says == "charges, dark":  # a light below one spike in 120 cycles is exactly dark
        shown, true = seen(there)
        assert np.all(shown[:, true[1] * DIM < 1 / 150] == 0) and shown.max() > 0.5


@pytest.mark.parametrize("says", ["writes", "charges"])
def test_what_finds_no_room_is_counted_and_named(tmp_path, capfd, says):
    """A buffer of a few bytes takes neither registers nor charges, nor the spikes."""
    link = {"link": LINK["link"], "code": {"cycles": 64, "buffer": "2 ms", "rate": "60 kbit/s"}}
    result, metrics, _ = run(data_of(says, DISPLAY | link), tmp_path / "a")
    notes = capfd.readouterr().err
    assert result.outcome == "degraded" and metrics["ancillary_bytes"] == 0
    count = f"{metrics['ancillary_dropped']:.0f}"
    assert metrics["ancillary_dropped"] > 0
    assert f"{count} packets of register writes or charges were not sent: the send" in notes
    assert "not exactly the camera's: 100 % of the spikes are not shown in their cycle" in notes


@pytest.mark.parametrize("says", ["writes", "dark"])
def test_a_board_displays_the_planes_of_what_is_said(tmp_path, says):
    _, metrics, _ = run(data_of(says, BOARD), tmp_path / "a")
    assert metrics["sink_planes"] == 400 and metrics["sink_crc_wrong"] == 0


@pytest.mark.slow
@pytest.mark.parametrize("says", ["writes", "dark"])
@pytest.mark.parametrize("sink", ["display", "link, display", "link, board"])
def test_a_board_says_it_too(tmp_path, says, sink):
    """The host writes the registers of the board; behind it is what is behind a simulated chip."""
    data = data_of(says, {
        "display": DISPLAY, "link, display": DISPLAY | LINK, "link, board": BOARD | LINK,
    }[sink])  # fmt: skip
    data |= {"duration": "10 ms", "scene": {"kind": "step", "illuminance": "700 lux",
             "at": "0 s", "after": 1}}  # fmt: skip
    del data["sensor"]["width"], data["sensor"]["height"]
    data["sensor"] |= {"source": "serial:virtual"}
    result, metrics, machine = run(data, tmp_path / "a")
    assert result.outcome == "ok" and metrics["board_bits_wrong"] == 0
    if "link" in sink:
        assert metrics["dropped_spikes"] == metrics["added_spikes"] == 0
    if "board" in sink:
        assert metrics["sink_planes"] == 400 and metrics["sink_crc_wrong"] == 0
        return
    shown, true = seen(machine)
    if says == "writes":
        assert shown[1].mean() == pytest.approx(shown[0].mean(), rel=0.06)
        assert shown[2, 8:24].mean() == pytest.approx(shown[1, 8:24].mean(), rel=0.03)
        assert np.all(shown[2, :8] == 0)
    else:
        assert np.all(shown[:, true[0] * BRIGHT < 1 / 20] == 0) and shown.max() > 0.5


@pytest.mark.parametrize("says", ["writes", "charges", "dark"])
def test_a_run_is_played_again_with_what_its_chip_said(tmp_path, says, capsys):
    """From the folder of the run: the light is that of the run, to the last bit. Its stream by
    itself has the spikes alone."""
    _, filmed, here = run(data_of(says, DISPLAY), tmp_path / "a")

    def again(name, source):
        data = {
            "title": "again", "sensor": {"source": f"file:{source}", "white_rate": SAYS[says][0]},
            "image": {"at": AT, "window": 21}, **DISPLAY,
        }  # fmt: skip
        return run(data, tmp_path / name)

    if says != "dark":  # an .npz and a .vfl keep it, and others say that they do not
        for ending in ("npz", "vfl"):
            assert _main(["convert", f"{tmp_path}/a", f"{tmp_path}/a.{ending}"]) == 0
            _, _, copied = again(ending, tmp_path / f"a.{ending}")
            light = copied.behind.screen.chain.images()[SPIKE]["camera"]
            np.testing.assert_allclose(light, seen(here)[0], atol=1e-6)
        assert "does not keep" not in capsys.readouterr().err
        assert _main(["convert", f"{tmp_path}/a.vfl", f"{tmp_path}/a.fsc"]) == 0
        assert "does not keep what the chip says beyond its spikes" in capsys.readouterr().err
        viform.save(viform.open(tmp_path / "a"), tmp_path / "b.npz")
        assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()
    _, played, there = again("b", tmp_path / "a")
    shown = there.behind.screen.chain.images()[SPIKE]["camera"]
    np.testing.assert_allclose(shown, seen(here)[0], atol=1e-6)
    assert played["total_light"] == pytest.approx(filmed["total_light"])
    assert played.get("dark_spikes_rejected") == filmed.get("dark_spikes_rejected")
    with viform.Display(renderer="numpy", observer="camera", exposure="2 ms") as display:
        called = display.show(tmp_path / "a", at=AT).images["camera"]
        opened = display.show(viform.open(tmp_path / "a"), at=AT, white_rate=SAYS[says][0])
    np.testing.assert_allclose(called, shown, atol=1e-6)
    np.testing.assert_allclose(opened.images["camera"], shown, atol=1e-6)
    _, _, alone = again("c", tmp_path / "a" / "stream.zarr")
    light = alone.behind.screen.chain.images()[SPIKE]["camera"]
    assert np.abs(light - shown).max() > 0.05


def test_a_display_in_python_follows_the_writes_of_a_camera():
    """Frames of one grey through a camera whose threshold is halved: the panel shows one light,
    also from a part of the stream."""
    keys = {"width": 32, "height": 24, "threshold": "1000 e", "clock": "40 kHz"}
    frames = np.full((40, 24, 32), 0.5, np.float32)
    with (
        viform.Camera(**keys, writes=WRITES[:1], device="numba") as camera,
        viform.Display(drive="impulse", renderer="numpy", observer="camera", exposure="2 ms")
        as display,
    ):  # fmt: skip
        spikes = camera.film(frames, frame_rate=4000, white_rate=BRIGHT)
        assert [each.cycle for each in spikes.ancillary] == [130]
        rates = [spikes[a:b].rate().mean() for a, b in ((50, 130), (150, 230))]
        assert rates[1] / rates[0] == pytest.approx(2, rel=0.03)
        for part, at in ((spikes, (90, 190)), (spikes[96:], (190 - 96,))):
            seen = display.show(part, at=list(at), white_rate=BRIGHT).images["camera"]
            assert len(seen) == len(at)
            for image in seen:
                assert image.mean() == pytest.approx(0.5, rel=0.02)


@pytest.mark.parametrize("method", ["tfp", "tfi"])
def test_images_have_the_light_of_the_nominal_threshold(tmp_path, method):
    """From the folder of a run, from an .npz, and those of the run itself."""
    data = data_of("writes", {}) | {"image": {"at": AT, "window": 41}}
    run(data, tmp_path / "a")
    assert _main(["convert", f"{tmp_path}/a", f"{tmp_path}/a.npz"]) == 0
    light = {}
    for at in AT:
        for source in ("a", "a.npz"):
            words = ["--at", f"{at}", "--method", method, "--scale", f"{BRIGHT}", "--out"]
            out = tmp_path / f"{source}-{at}.png"
            own = ["--window", "41"] if method == "tfp" else []
            assert _main(["image", f"{tmp_path}/{source}", *words, f"{out}", *own]) == 0
        of_run = tmp_path / "a" / "images" / f"{method}-{at:05d}.png"
        assert out.read_bytes() == of_run.read_bytes()
        assert out.read_bytes() == (tmp_path / f"a-{at}.png").read_bytes()
        light[at] = viform.reconstruct(viform.open(tmp_path / "a"), at, method)
    inside = slice(8, 24)
    for at in AT[1:]:
        assert light[at][inside].mean() == pytest.approx(light[AT[0]][inside].mean(), rel=0.05)
    assert np.all(light[AT[2]][:8] == 0)
    spikes = viform.open(tmp_path / "a.npz")[96:]
    part = viform.reconstruct(spikes, AT[1] - 96, method)
    if method == "tfp":
        np.testing.assert_allclose(part, light[AT[1]], rtol=1e-6)
    else:
        assert part[inside].mean() == pytest.approx(light[AT[1]][inside].mean(), rel=0.01)


@pytest.mark.parametrize("says", ["writes", "charges", "dark"])
def test_cameras_film_the_light_of_what_is_said(tmp_path, says):
    """Frames of 2 ms, one after another, have the light that an eye sees of the display; a spike
    camera has its rate."""
    frames = {"kind": "frames", "frame_rate": "500 Hz", "exposure": "2 ms", "readout": "0 s",
              "full_well": "1000000 e", "read_noise": "0 e", "bits": 16, "white": 0.25}  # fmt: skip
    display = {"display": DISPLAY["display"] | {"drive": "causal", "row_scan": 0}}
    image = {"at": [120, 200, 360], "window": 21}  # the middles of frames 1, 2 and 4
    _, _, machine = run(data_of(says, display, camera=frames, image=image), tmp_path / "a")
    pictures = machine.behind.screen.camera.camera.pictures()
    assert len(pictures) == 5
    packet = 1 / (CYCLES * SAYS[says][0])
    eye = machine.behind.screen.chain.panel_stage.images["camera"]
    for picture, of_eye in zip((pictures[n] for n in (1, 2, 4)), eye, strict=True):
        # Half a plane apart, with the noise of the camera.
        assert picture.mean() == pytest.approx(of_eye.mean(), rel=0.01)
        assert np.abs(picture - of_eye).max() < 0.5 * packet + 0.02
        lit = of_eye > 0.02
        assert not np.any(lit & (picture == 0)) and np.all(picture[of_eye == 0] < 0.5 * packet)
    spikes = {"kind": "spikes", "sensor": {"threshold": "1000 e", "clock": "20 kHz"}}
    _, seen_by, _ = run(data_of(says, display, camera=spikes), tmp_path / "b")
    light = np.mean([picture.mean() for picture in pictures])
    assert seen_by["camera_spike_rate"] == pytest.approx(
        light * seen_by["camera_white_rate"], rel=0.03
    )


def test_what_cannot_follow_is_one_line(tmp_path):
    with pytest.raises(InputError) as caught:
        run(data_of("charges", BOARD), tmp_path / "run")
    assert str(caught.value) == (
        "sensor.sub_threshold must be absent with display.sink, not given; leave one of them out: "
        "a board displays the spikes alone"
    )
    assert not (tmp_path / "run").exists()
