"""The reset rule of moving recordings: right, or not known."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest

import viform
from cosim.spikes.viform import Viform
from sensor.calibrate.calibration import Recording, calibrate
from sensor.calibrate.known import Parameter
from sensor.calibrate.moving import moving_reset_rule
from sensor.calibrate.trains import read_trains
from sensor.device.chips import CHIPS
from tests.sensor.calibrate.simulated import CLOCK

SPEEDS = (0.0, 0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0)
SHAPE = (40, 48)
CAMERAS = 20


def texture(kind: str, rng: np.random.Generator, low: float, high: float) -> npt.NDArray:
    """A periodic picture of 128 x 128, spikes a cycle: of the spectrum 1/f^2 ("natural"), 1/f
    ("pink") or flat ("white") in power, or stripes of some pixels."""
    if kind.startswith("stripes"):
        wave = np.sin(2 * np.pi * np.round(128 / float(kind[7:])) * np.arange(128) / 128)
        return (low + (high - low) * (wave + 1) / 2) * np.linspace(0.7, 1, 128)[:, None]
    frequency = np.hypot(np.fft.fftfreq(128)[:, None], np.fft.fftfreq(128))
    frequency[0, 0] = 1
    power = {"natural": 1.0, "pink": 0.5, "white": 0.0}[kind]
    z = np.fft.ifft2(np.fft.fft2(rng.standard_normal((128, 128))) / frequency**power).real
    z = (z - z.mean()) / z.std()
    return np.clip((low + high) / 2 + z * (high - low) / 4, low / 2, 1.3 * high)


def filmed(
    picture: npt.NDArray, speed: float, cycles: int, rule: str, noise: float,
    rng: np.random.Generator, prnu: float = 0.02,
) -> Viform:  # fmt: skip
    """What a camera of SHAPE shows of a picture that moves by `speed` pixels a cycle: charge in
    thresholds, a threshold of the relative standard deviation `noise` drawn for each spike."""
    gain = 1 + prnu * rng.standard_normal(SHAPE)
    charge, threshold = rng.random(SHAPE), np.ones(SHAPE)
    rows, columns = np.arange(SHAPE[0])[:, None], np.arange(SHAPE[1])
    angle = rng.uniform(0, 2 * np.pi)
    planes = np.zeros((cycles, *SHAPE), np.uint8)
    for cycle in range(cycles):
        y, x = (speed * cycle * f(angle) for f in (np.sin, np.cos))
        (i, v), (j, u) = divmod(y, 1), divmod(x, 1)
        near, far = (
            (1 - u) * row[:, (columns + int(j)) % 128] + u * row[:, (columns + int(j) + 1) % 128]
            for row in (picture[(rows[:, 0] + int(i) + k) % 128] for k in (0, 1))
        )
        charge += gain * ((1 - v) * near + v * far)
        fires = charge >= threshold
        planes[cycle] = fires
        charge[fires] = 0.0 if rule == "hard" else (charge - threshold)[fires]
        threshold[fires] = 1 + noise * rng.standard_normal(int(fires.sum()))
    return Viform.from_planes(planes, CLOCK)


def reset_of(stream: Viform) -> Parameter:
    return moving_reset_rule(read_trains(stream, "a"))


def wrong(found: Parameter, rule: str) -> bool:
    return found.known and found.value != rule


@pytest.mark.parametrize("rule", ["residual", "hard"])
def test_a_moving_picture_is_never_taken_for_the_other_rule(rule: str) -> None:
    known = {}
    for speed in SPEEDS:
        rng = np.random.default_rng(3)
        found = reset_of(filmed(texture("natural", rng, 0.15, 0.5), speed, 400, rule, 0.02, rng))
        assert not wrong(found, rule), speed
        assert found.known != bool(found.remedy)
        known[speed] = found.known
    assert known[0.0] and known[0.02] and not known[2.0]


def test_power_of_differences_is_that_of_the_rounding() -> None:
    """The closed forms of the docstring: mean squares of 20/12 and 70/12 with a residual."""
    rng = np.random.default_rng(1)
    picture = texture("natural", rng, 0.15, 0.5)
    trains = read_trains(filmed(picture, 0.01, 600, "residual", 0.0, rng), "a")
    changes = trains.changes(np.ones(trains.spikes.size, bool))
    number = changes.number.sum()
    assert number > 1e5
    assert changes.second.sum() / number == pytest.approx(20 / 12, rel=0.05)
    assert changes.third.sum() / number == pytest.approx(70 / 12, rel=0.05)


@pytest.mark.parametrize("rate", [0.31, 0.25])
def test_pixels_that_all_begin_empty_look_moving(rate: float) -> None:
    """Without noise the counts of cycles jump; intervals of 4 cycles are those of either rule."""
    gain = rate * (1 + 0.02 * np.random.default_rng(6).standard_normal(SHAPE))
    total = np.floor(gain * np.arange(301)[:, None, None] + 1e-9)
    stream = Viform.from_planes(np.diff(total, axis=0).astype(np.uint8), CLOCK)
    result = calibrate(Recording("a", stream))
    assert result.roles == {"a": "moving"}
    assert not wrong(result.parameters["reset"], "residual")


@pytest.mark.parametrize("speed", [0.05, 0.2])
def test_motion_that_is_too_little_to_be_seen(speed: float) -> None:
    """A mean interval of 3 cycles is whole, so every motion changes its rounding."""
    rng = np.random.default_rng(3)
    stream = filmed(texture("pink", rng, 0.33, 0.35), speed, 474, "residual", 0.003, rng, 0.005)
    result = calibrate(Recording("a", stream))
    assert result.roles == {"a": "flat"}
    assert not wrong(result.parameters["reset"], "residual")


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["natural", "pink", "white", "stripes8", "stripes11"])
@pytest.mark.parametrize("rule", ["residual", "hard"])
def test_twenty_moving_cameras_of_each_rule(kind: str, rule: str) -> None:
    right = mistakes = 0
    for seed in range(CAMERAS):
        for speed in SPEEDS:
            rng = np.random.default_rng([47, seed, int(rule == "hard")])
            low = rng.uniform(0.05, 0.25)
            picture = texture(kind, rng, low, low + rng.uniform(0.02, 0.35))
            noise = float(np.exp(rng.uniform(np.log(0.003), np.log(0.08))))
            cycles = int(rng.integers(160, 640))
            found = reset_of(filmed(picture, speed, cycles, rule, noise, rng))
            mistakes += wrong(found, rule)
            right += found.value == rule
    assert mistakes <= 0.05 * CAMERAS * len(SPEEDS)
    assert right >= CAMERAS // 2


@pytest.mark.slow
@pytest.mark.parametrize("rule", ["residual", "hard"])
@pytest.mark.parametrize("preset", ["ideal", "silicon"])
@pytest.mark.parametrize("chip", [name for name in CHIPS if name != "spikeasync"])
def test_every_preset_still_and_moving(chip: str, preset: str, rule: str) -> None:
    rng = np.random.default_rng(9)
    picture = texture("natural", rng, 0.1, 0.75).astype(np.float32)
    with viform.Camera(
        chip, preset=preset, threshold="1000 e", seed=1, width=SHAPE[1], height=SHAPE[0],
        reset=rule,
    ) as camera:  # fmt: skip
        for speed in (0, 1, 8):  # pixels a frame of 20 cycles
            if speed:
                frames = np.stack([
                    np.roll(picture, speed * n, 1)[: SHAPE[0], : SHAPE[1]] for n in range(50)
                ])  # fmt: skip
            else:
                frames = np.broadcast_to(np.float32(0.6), (50, *SHAPE))
            found = calibrate(Recording("a", camera.film(frames, frame_rate=2000.0)))
            assert not wrong(found.parameters["reset"], rule), speed
