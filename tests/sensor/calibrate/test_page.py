"""The preset file: what calibration writes, a scenario reads, and a run films with."""

from __future__ import annotations

import shlex
import tomllib
from pathlib import Path

import numpy as np
import pytest

from cosim import Clock, InputError
from cosim.config.toml import to_toml
from cosim.spikes.viform import Viform
from scenarios.assemble.lens import choose_lens
from scenarios.assemble.schema.loading import load
from scenarios.cli.study.calibrate import film_command
from sensor import CHIPS, CameraSetting
from sensor.calibrate.calibration import Recording, calibrate
from sensor.calibrate.page import preset_text
from sensor.device.pattern import DevicePattern
from tests.sensor.calibrate.simulated import Truth

FILE = """
[sensor]
width = 64
height = 48
threshold = "2000 e"
dead_time = "1 us"
[sensor.pattern]
prnu = 0.03
dsnu = 0.2
[of_threshold]
interval_noise = 0.05
dark_current = 20.0
"""


@pytest.fixture
def camera(tmp_path: Path) -> Path:
    path = tmp_path / "camera.toml"
    path.write_text(FILE)
    return path


def test_what_is_calibrated_is_what_a_scenario_has(tmp_path: Path) -> None:
    pattern = DevicePattern(prnu=0.03, threshold_fpn=0.03, dark=8e5, dsnu=0.1, device_seed=4)
    truth = Truth(4000.0, 60.0, pattern, 1e-6, (32, 48))
    flats = [Recording(str(r), truth.record(r, 2000, n)) for n, r in enumerate((0.1, 0.5))]
    result = calibrate(flats[0], flats[1:], Recording("dark", truth.record(0, 2000, 9)))
    text = preset_text(result)
    assert text is not None
    (tmp_path / "camera.toml").write_text(text)
    scenario = tmp_path / "scene.toml"
    scenario.write_text(
        'title = "A clip"\nduration = "1 ms"\n[scene]\nkind = "film"\nilluminance = "700 lux"\n'
        '[sensor]\npreset = "camera.toml"\n'
    )
    sensor = load(str(scenario))[1].sensor
    found = {name: p.value for name, p in result.parameters.items()}
    assert (sensor.width, sensor.height) == (48, 32)
    assert sensor.dead_time == found["dead_time"]
    for name in ("prnu", "threshold_fpn", "dsnu"):
        assert getattr(sensor.pattern, name) == found[name]
    noise = np.sqrt(1 / sensor.threshold + (sensor.threshold_noise / sensor.threshold) ** 2)
    assert noise == pytest.approx(found["interval_noise"], rel=1e-6)
    dark = sensor.pattern.dark_current / sensor.threshold
    assert dark == pytest.approx(found["dark_current"], rel=1e-9)
    # A resolved scenario reads back as itself, wherever it is.
    again = tmp_path / "elsewhere.toml"
    resolved = load(str(scenario))[1]
    again.write_text(to_toml(resolved))
    assert load(str(again))[1] == resolved


def sets_of(command: str) -> list[str]:
    """The values of --set of a command that films."""
    words = shlex.split(command)
    assert words[:3] == ["viform", "run", "film"]
    assert words[3::2] == ["--set"] * (len(words) // 2 - 1)
    return words[4::2]


@pytest.mark.parametrize("electrons", [60, 14_201, None])
@pytest.mark.parametrize("hertz", [10_000, 20_000])
def test_the_printed_command_takes_the_printed_preset(
    tmp_path: Path, electrons: int | None, hertz: int
) -> None:
    """Renewal processes of this many electrons, None for no noise: film has a threshold of 1000 e
    and a clock of 40 kHz, which would win."""
    rng = np.random.default_rng(4)
    spread = 0.0 if electrons is None else electrons**-0.5
    period = 3.4 * (1 + 0.02 * rng.standard_normal(768))
    each = 1 + spread * rng.standard_normal((120, 768))
    each[0] = rng.random(768)
    at = np.cumsum(period * np.maximum(each, 0.3), axis=0).astype(int)
    planes = np.zeros((300, 768), np.uint8)
    seen = at < 300
    planes[at[seen], np.broadcast_to(np.arange(768), at.shape)[seen]] = 1
    stream = Viform.from_planes(planes.reshape(300, 24, 32), Clock(hertz))
    text = preset_text(calibrate(Recording("a", stream)))
    assert text is not None
    path = tmp_path / "a camera.toml"
    path.write_text(text)
    scenario = load("film", sets_of(film_command(text, path)))[1]
    sensor = scenario.sensor
    written = tomllib.loads(text)
    noise = np.hypot(sensor.threshold**-0.5, sensor.threshold_noise / sensor.threshold)
    assert noise == pytest.approx(written["of_threshold"]["interval_noise"], rel=1e-3)
    setting = CameraSetting(
        CHIPS[sensor.chip], Clock(hertz), sensor.threshold, 1, sensor.wavelength
    )
    assert choose_lens(scenario, setting).white_rate == 0.6  # there is light enough for it
    assert sensor.clock == hertz and (sensor.width, sensor.height) == (32, 24)


def test_without_a_dark_recording_the_preset_says_so() -> None:
    truth = Truth(4000.0, 60.0, DevicePattern(prnu=0.03, device_seed=4), 0.0, (32, 48))
    text = preset_text(calibrate(Recording("a", truth.record(0.4, 1000, 1))))
    assert text is not None
    data = tomllib.loads(text)
    assert data["sensor"]["pattern"]["prnu"] == pytest.approx(0.03, rel=0.1)
    assert "dark_current" not in data["of_threshold"]
    assert "# dark_current: not known; " in text


def test_the_scenarios_own_keys_win(camera: Path) -> None:
    sets = [f"sensor.preset={camera}", "sensor.dead_time=2 us", "sensor.pattern.prnu=0.01"]
    sensor = load("film", sets)[1].sensor
    assert sensor.threshold == 1000  # of film
    assert sensor.dead_time == 2e-6 and sensor.pattern.prnu == 0.01
    # Charges are shares of the threshold in force.
    assert sensor.pattern.dark_current == pytest.approx(20 * 1000)
    assert sensor.threshold_noise == pytest.approx(1000 * np.sqrt(0.05**2 - 1 / 1000))


@pytest.mark.parametrize(
    ("text", "sets", "says"),
    [
        (FILE + "x = 1\n", [], "of_threshold.x in"),
        (FILE.replace("prnu", "prno"), [], "did you mean prnu?"),
        (FILE.replace("dead_time", "dead_tme"), [], "did you mean dead_time?"),
        (FILE.replace("20.0", "-1"), [], "must be a number of 0 or more, not -1"),
        (FILE.replace("20.0", "'a'"), [], "must be a number of 0 or more, not 'a'"),
        ("a = = 1", [], "a TOML file of `viform calibrate`"),
        (FILE, ["sensor.threshold=300 e"], "write --set sensor.threshold='400 e'"),
        (FILE, ["sensor.pixel=asynchronous"], "latched pixels"),
        (FILE.replace("0.2", "2.0"), [], "sensor.pattern.dsnu must be"),
    ],
)
def test_a_wrong_preset_is_refused_in_one_line(
    camera: Path, text: str, sets: list[str], says: str
) -> None:
    camera.write_text(text)
    with pytest.raises(InputError) as caught:
        load("film", [f"sensor.preset={camera}", *sets])
    assert says in str(caught.value) and "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["gone.toml", "metal", "camera.txt"])
def test_an_absent_preset_is_refused(name: str) -> None:
    with pytest.raises(InputError, match="ideal, silicon"):
        load("film", [f"sensor.preset={name}"])
