"""A rolling shutter before a panel: closed forms of its exposures and bands, and its checkpoint."""

import math

import numpy as np
import pytest

from cosim import Block, Clock, InputError
from cosim.spikes.viform import Viform
from display.camera.rolling import make_shutter
from display.camera.section import FramesSection
from display.camera.stage import PanelCamera, banding, pulse_banding
from display.panels.panel import SpikePanel

CLOCK = Clock(40_000)


def film(planes, section, **panel):
    """The camera after (T, H, W) planes on a panel without noise worth mention."""
    screen = SpikePanel(planes.shape[1:], CLOCK, panel.pop("white", 1.0), **panel)
    camera = PanelCamera(section, make_shutter(section, screen, len(planes)), 1)
    stream = Viform.from_planes(planes, CLOCK)
    for first in range(0, len(planes), 64):
        count = min(64, len(planes) - first)
        words = stream.words[first // 32 : -(-(first + count) // 32)]
        camera.step(Viform(words, count, CLOCK, first), Block(first, count))
    return camera


def frames(**keys):
    quiet = {"full_well": "2e6 e", "read_noise": "0 e", "bits": 16, "white": 0.5}
    return FramesSection(**({"kind": "frames"} | quiet | keys))


@pytest.mark.parametrize("exposure", ["250 us", "400 us", "1.1 ms"])
def test_bands_of_pulses_are_those_of_the_closed_form(exposure):
    """Every pixel fires each 20 cycles, 2 kHz, for a whole cycle of 20; 512 rows are read out over
    four periods."""
    section = frames(frame_rate="200 Hz", exposure=exposure, readout="2 ms")
    planes = np.zeros((400, 512, 2), bool)
    planes[::20] = True
    camera = film(planes, section, drive="impulse", row_scan=0.0)
    contrasts, profiles = camera.bands()
    expected = pulse_banding(1 / 20, 2000.0, section.exposure)
    assert contrasts[1] == pytest.approx(expected, rel=0.01)
    # The fundamental is weakened by |sinc(f T)|, that of the pulse by sinc(d).
    phase = np.exp(-2j * np.pi * 4 * np.arange(512) / 512)
    fundamental = 2 * abs((profiles[1] * phase).mean()) / profiles[1].mean()
    assert fundamental == pytest.approx(
        2 * np.sinc(1 / 20) * abs(np.sinc(2000 * section.exposure)), rel=0.01
    )


@pytest.mark.parametrize("duty", [0.05, 0.3, 0.8])
@pytest.mark.parametrize("periods", [0.1, 0.5, 0.95, 2.3])
def test_the_closed_form_is_the_sum_of_its_harmonics(duty, periods):
    k = np.arange(1, 20_000)
    square = 2 * (np.sinc(k * duty) * np.sinc(k * periods)) ** 2
    assert pulse_banding(duty, 1.0, periods) == pytest.approx(math.sqrt(2 * square.sum()), rel=1e-3)


def test_an_exposure_of_whole_periods_has_no_bands():
    assert pulse_banding(0.1, 2000.0, 1e-3) == pytest.approx(0, abs=1e-6)
    planes = np.zeros((400, 64, 2), bool)
    planes[::20] = True
    camera = film(planes, frames(frame_rate="200 Hz", exposure="1 ms", readout="2 ms"),
                  drive="impulse", row_scan=0.0)  # fmt: skip
    assert camera.bands()[0][1] < 6e-3  # its photons alone: 0.0045


def test_steady_light_is_exposed_to_white():
    """A pixel that fires in every cycle under the hold drive is white from its second spike on."""
    camera = film(np.ones((200, 8, 4), bool), frames(frame_rate="1 kHz", exposure="500 us",
                  readout="400 us"), drive="hold")  # fmt: skip
    assert len(camera.frames) == 5  # 5 ms of light; the last one ends at 4.85 ms
    for picture in camera.pictures()[1:]:
        np.testing.assert_allclose(picture, 1.0, atol=6e-3)
    assert camera.flicker() is not None


def test_a_step_of_the_light_reaches_each_row_at_its_time():
    """All pixels light up in plane 100: a row that is half exposed by then has half the light."""
    planes = np.zeros((400, 8, 1), bool)
    planes[100:] = True
    section = frames(frame_rate="100 Hz", exposure="2 ms", readout="4 ms")
    camera = film(planes, section, drive="impulse", row_scan=0.0)
    start = 100 / 40e3 - np.arange(8) / 8 * 4e-3  # the light, after each row's beginning
    expected = np.clip((2e-3 - start) / 2e-3, 0, 1)
    np.testing.assert_allclose(camera.pictures()[0][:, 0], expected, atol=6e-3)


def test_a_pixel_sees_the_mean_of_its_box():
    planes = np.zeros((100, 4, 6), bool)
    planes[:, :2, :3] = True
    camera = film(planes, frames(frame_rate="1 kHz", exposure="1 ms", readout="0 s", width=2,
                  height=1), drive="impulse")  # fmt: skip
    np.testing.assert_allclose(camera.pictures()[1], [[0.5, 0.0]], atol=1e-2)


def test_noise_is_that_of_photons_and_reading():
    section = frames(frame_rate="1 kHz", exposure="1 ms", readout="0 s", full_well="4000 e",
                     read_noise="20 e")  # fmt: skip
    camera = film(np.ones((140, 100, 100), bool), section, drive="impulse", row_scan=0.0)
    electrons = camera.frames[1].values * (4000 / 65535)
    assert electrons.mean() == pytest.approx(2000, abs=5 * math.sqrt(2400 / 1e4))
    assert electrons.var() == pytest.approx(2400, rel=5 * math.sqrt(2 / 1e4))


def test_a_checkpoint_goes_on_with_the_same_bits():
    rng = np.random.default_rng(3)
    planes = rng.random((320, 6, 8)) < 0.3
    section = frames(frame_rate="500 Hz", exposure="900 us", readout="1 ms", full_well="900 e")
    whole = film(planes, section)
    screen = SpikePanel((6, 8), CLOCK, 1.0)
    stream = Viform.from_planes(planes, CLOCK)
    camera = PanelCamera(section, make_shutter(section, screen, 320), 1)
    for first in range(0, 320, 64):
        after = PanelCamera(section, make_shutter(section, screen, 320), 1)
        after.restore({k: v.copy() for k, v in camera.state().items()})
        camera = after
        words = stream.words[first // 32 : first // 32 + 2]
        camera.step(Viform(words, 64, CLOCK, first), Block(first, 64))
    assert len(camera.frames) == len(whole.frames) == 4
    for one, two in zip(camera.frames, whole.frames, strict=True):
        np.testing.assert_array_equal(one.values, two.values)
        np.testing.assert_array_equal(one.steady, two.steady)


def test_only_frames_that_are_exposed_are_open(monkeypatch):
    """A word of a slow panel lasts as long as a great many frames."""
    opened = []
    finish = PanelCamera._finish
    monkeypatch.setattr(
        PanelCamera, "_finish", lambda self, n: (opened.append(len(self._open)), finish(self, n))
    )
    section = frames(frame_rate="20 kHz", exposure="40 us", readout="0 s")
    camera = film(np.ones((64, 2, 2), bool), section)
    assert len(opened) == len(camera.frames) == 32 and max(opened) <= 4


def test_a_dark_panel_has_no_contrast():
    assert banding(np.zeros((4, 4)), np.zeros(4))[0] is None
    camera = film(np.zeros((100, 4, 4), bool), frames(frame_rate="1 kHz", exposure="1 ms",
                  readout="0 s"))  # fmt: skip
    assert camera.bands()[0] == [] and camera.flicker() is None


@pytest.mark.parametrize(
    ("keys", "says"),
    [
        ({"width": 5}, "camera.width must be a divisor of the panel's 8, not 5; write 4"),
        (
            {"exposure": "9 ms"},
            "duration must be at least 10 ms, a frame of the camera, not 8 ms; lengthen it, or "
            "shorten camera.exposure and camera.readout",
        ),
        (
            {"exposure": "9.01 ms"},  # and a run has whole planes
            "duration must be at least 10.025 ms, a frame of the camera, not 8 ms; lengthen it, "
            "or shorten camera.exposure and camera.readout",
        ),
    ],
)
def test_what_does_not_fit_is_refused(keys, says):
    section = frames(**({"frame_rate": "100 Hz", "readout": "2 ms"} | keys))
    with pytest.raises(InputError) as caught:
        make_shutter(section, SpikePanel((2, 8), CLOCK, 1.0), 320)
    assert str(caught.value) == says


def test_an_exposure_beyond_a_frame_is_refused():
    with pytest.raises(InputError) as caught:
        frames(frame_rate="60 Hz", exposure="17 ms")
    said = str(caught.value)
    assert said == (
        "camera.exposure must be at most a frame, 16.6666666667 ms, not 17 ms; write "
        "--set camera.exposure='16.6666666667 ms', or lower camera.frame_rate"
    )
    frames(frame_rate="60 Hz", exposure="16.6666666667 ms")  # what the line proposes


@pytest.mark.parametrize(
    ("exposure", "readout", "says"),
    [
        ("9 ms", "2 ms", "camera.exposure must be at most 7 ms with 8 ms of the recording, for a "),
        ("1 ms", "40 ms", "camera.readout must be at most 4 ms with 8 ms of the recording, for a "),
    ],
)
def test_a_recording_too_short_for_a_frame_is_refused_by_the_camera(exposure, readout, says):
    """Its planes cannot be more; the limit given is accepted."""
    keys = {"frame_rate": "25 Hz", "exposure": exposure, "readout": readout}
    panel = SpikePanel((2, 8), CLOCK, 1.0)
    with pytest.raises(InputError) as caught:
        make_shutter(frames(**keys), panel, 320, recorded=True)
    assert str(caught.value).startswith(says)
    key = caught.value.what.removeprefix("camera.")
    keys[key] = str(caught.value).split("at most ")[1].split(" with")[0]
    assert make_shutter(frames(**keys), panel, 320, recorded=True).frames >= 1
