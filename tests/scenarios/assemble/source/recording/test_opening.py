"""A recorded stream in the place of a chip: its formats, clock, length and white."""

import json

import numpy as np
import pytest

from cosim import Block, Clock, Events, InputError, Viform
from cosim.config.toml import to_toml
from cosim.files import write_events, write_stream
from cosim.run.inputs import add_digests, changed_files
from scenarios.assemble.schema.loading import load
from scenarios.assemble.schema.messages import validate
from scenarios.assemble.source.recording.opening import open_recording
from sensor.codec.coding import Code
from sensor.codec.files import write_coded

CLOCK = Clock(20_000)
PLANES = np.random.default_rng(5).random((70, 8, 16)) < 0.25


def opened(path, **keys):
    sensor = {"source": f"file:{path}"} | keys.pop("sensor", {})
    return open_recording(validate({"title": "r", "sensor": sensor} | keys))


def planes_of(recording):
    stage, parts = recording.stage(), []
    for first in range(0, recording.cycles, 64):
        count = min(64, recording.cycles - first)
        parts.append(stage.step(None, Block(first, count)).planes())
    return np.concatenate(parts)


def written(folder, ending):
    stream, path = Viform.from_planes(PLANES, CLOCK), folder / f"a{ending}"
    if ending == ".fsc":
        write_coded(stream, path, Code("line"))
    else:
        write_stream(stream, path)
    return path


@pytest.mark.parametrize("ending", [".npz", ".zarr", ".events.npz", ".fsc", ".dat"])
def test_every_format_gives_its_planes(ending, tmp_path):
    size = {"clock": "20 kHz", "width": 16, "height": 8} if ending == ".dat" else {}
    found = opened(written(tmp_path, ending), sensor=size)
    assert (found.shape, found.cycles, found.clock) == ((8, 16), 70, CLOCK)
    np.testing.assert_array_equal(planes_of(found), PLANES)


def test_a_duration_takes_the_first_part(tmp_path):
    found = opened(written(tmp_path, ".npz"), duration="2.25 ms")
    np.testing.assert_array_equal(planes_of(found), PLANES[:45])


def test_events_of_a_fine_clock_are_latched(tmp_path):
    fine = Events(
        np.array([0, 1], np.uint16), np.array([2, 0], np.uint16), np.array([49_999, 50_000]),
        np.array([50_000, 50_001]), (2, 3), 200_000, Clock(10**9),
    )  # fmt: skip
    write_events(fine, tmp_path / "stream.events.npz")
    found = opened(tmp_path, sensor={"clock": "20 kHz"})  # the folder of a run
    assert (found.cycles, found.shape) == (4, (2, 3))
    assert [tuple(p) for p in np.argwhere(planes_of(found))] == [(0, 0, 2), (1, 1, 0)]


def test_white_is_given_known_or_the_brightest(tmp_path):
    path = written(tmp_path, ".zarr")
    rate = np.quantile(PLANES.mean(axis=0), 0.99, method="higher")
    assert opened(path).white_rate == pytest.approx(rate)
    assert opened(path, sensor={"white_rate": 0.7}).white_rate == 0.7
    run = tmp_path / "run"
    run.mkdir()
    write_stream(Viform.from_planes(PLANES, CLOCK), run / "stream.zarr")
    told = {"metrics": {"white_rate": {"value": 0.6, "unit": "spikes/cycle"}}}
    (run / "result.json").write_text(json.dumps(told))
    assert opened(run).white_rate == opened(run / "stream.zarr").white_rate == 0.6
    told["metrics"]["camera_white_rate"] = {"value": 0.5, "unit": "spikes/cycle"}
    (run / "result.json").write_text(json.dumps(told))
    write_stream(Viform.from_planes(PLANES, CLOCK), run / "camera.zarr")
    assert opened(run / "camera.zarr").white_rate == 0.5
    (run / "result.json").write_text("{")
    assert opened(run).white_rate == pytest.approx(rate)
    write_stream(Viform.from_planes(np.zeros((9, 2, 2), bool), CLOCK), tmp_path / "dark.npz")
    dark = opened(tmp_path / "dark.npz")
    assert dark.white_rate == 1 and "is dark" in dark.notes[-1]


@pytest.mark.parametrize(
    ("ending", "keys", "says"),
    [
        (".npz", {"sensor": {"clock": "40 kHz"}}, "Hz, not 40000 Hz; leave it out"),
        (".npz", {"duration": "4 ms"},
         "duration must be from one cycle to all 70 cycles of the recording, 3.5 ms, not 4 ms; "
         "leave it out for all of them, or write one of these"),
        (".npz", {"sensor": {"width": 16}},
         "sensor.height must be given with sensor.width, not absent; add it"),
        (".events.npz", {"sensor": {"width": 9, "height": 8}}, "not 9 x 8; leave both out"),
        (".events.npz", {"sensor": {"clock": "2 MHz"}},
         "sensor.clock must be given, at most 1e+06 Hz, for events timed at 20000 Hz, not 2e+06 Hz"
         "; write --set sensor.clock='40 kHz', which latches them"),
    ],
)  # fmt: skip
def test_what_does_not_fit_the_file_is_one_line(ending, keys, says, tmp_path):
    with pytest.raises(InputError) as caught:
        opened(written(tmp_path, ending), **keys)
    assert str(caught.value).endswith(says)


def test_a_file_that_is_not_there_is_refused(tmp_path):
    with pytest.raises(InputError, match="must be a file that exists"):
        opened(tmp_path / "none.npz")


def test_a_path_is_relative_to_its_scenario_and_its_content_is_sealed(tmp_path):
    written(tmp_path, ".npz")
    (tmp_path / "s.toml").write_text('title = "r"\n[sensor]\nsource = "file:a.npz"\n')
    _, scenario = load(str(tmp_path / "s.toml"))
    assert scenario.sensor.source == f"file:{tmp_path / 'a.npz'}"
    sealed = add_digests(to_toml(scenario))
    assert sealed.startswith("# sensor.source: sha256 ")
    assert changed_files(sealed) == []
    written_again = Viform.from_planes(~PLANES, CLOCK)
    write_stream(written_again, tmp_path / "a.npz")
    assert changed_files(sealed) == [("sensor.source", str(tmp_path / "a.npz"))]
