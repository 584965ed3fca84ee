"""Chips of one's own: their keys, sizes from a pixel to millions, and the memory of a run."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from cosim import Block, Clock, InputError
from cosim.config.toml import to_toml
from cosim.light.survey import survey
from scenarios.assemble.chip import camera_setting
from scenarios.assemble.schema.loading import load
from scenarios.scenes.kinds.grid import SceneGrid
from sensor import CHIPS, CameraSetting

OWN = (
    "sensor.width=33", "sensor.height=21", "sensor.pitch=5 um", "sensor.fill_factor=0.5",
    "sensor.quantum_efficiency=0.35", "sensor.row_time=200 ns",
)  # fmt: skip


def camera(*sets: str) -> CameraSetting:
    return camera_setting(load("step", list(sets))[1])  # type: ignore[arg-type]


def test_given_numbers_replace_those_of_any_preset() -> None:
    for preset in ("spiketwo", "spikeone"):
        own, plain = camera(*OWN, f"sensor.chip={preset}"), camera(f"sensor.chip={preset}")
        assert (own.chip.width, own.chip.height) == (33, 21)
        # A quarter of the area, half of it lit, half of the electrons a photon.
        assert own.electrons_per_lux == pytest.approx(plain.electrons_per_lux / 16)
        # Row r of 21 is sampled r x 200 ns after the edge.
        np.testing.assert_array_equal(own.sampling_offsets, np.arange(21) * 200_000)
        said = own.chip.provenance()
        given = {"width", "height", "pitch", "fill_factor", "quantum_efficiency"}
        assert {name for name, origin in said.items() if origin == "given by the user"} == given
        assert said["clocks"] == plain.chip.provenance()["clocks"]
    part = CHIPS["spiketwo"].own(width=7, height=None)
    assert part.size_origin == "width given by the user, height published"


def test_row_time_states_the_skew_at_any_clock() -> None:
    assert camera("sensor.row_time=20 ns").row_skew == pytest.approx(0.8)
    assert camera("sensor.row_time=25 ns").row_skew == 1.0
    assert camera("sensor.row_time=20 ns", "sensor.clock=20 kHz").row_skew == pytest.approx(0.4)
    assert camera("sensor.row_time=20 ns", "sensor.row_skew=0.8").row_skew == pytest.approx(0.8)
    # The preset `silicon` assumes a skew of 1; a given time of a row overrides it.
    silicon = camera("sensor.preset=silicon", "sensor.row_time=20 ns")
    assert silicon.row_skew == pytest.approx(0.8)
    # A written scenario is read again.
    scenario = load("step", ["sensor.row_time=20 ns", "sensor.preset=silicon"])[1]
    assert "row_time" in to_toml(scenario)


@pytest.mark.parametrize(
    ("sets", "said"),
    [
        (["sensor.width=0"], "sensor.width must be at least 1, not '0'"),
        (["sensor.width=65536"], "sensor.width must be at most 65535"),
        (["sensor.width=8001", "sensor.height=8000"],
         "must be at most 64,000,000 pixels, not 8001 x 8000"),
        (["sensor.height=2.5"], "sensor.height must be a whole number"),
        (["sensor.pitch=5"], "sensor.pitch must be a length such as '10 um'"),
        (["sensor.pitch=0 um"], "above 0 um"),
        (["sensor.fill_factor=1.5"], "sensor.fill_factor must be at most 1"),
        (["sensor.quantum_efficiency=0"], "sensor.quantum_efficiency must be above 0"),
        (["sensor.row_time=20 lux"], "sensor.row_time must be a time such as '20 ns'"),
        (["sensor.row_time=30 ns"],
         "sensor.clock must be at most 33333.3 Hz for 1000 rows of 30 ns to fit in a cycle, not "
         "40000 Hz; lower it, or sensor.row_time"),
        (["sensor.row_time=20 ns", "sensor.row_skew=0.5"],
         "sensor.row_skew must be absent with sensor.row_time, which states 0.8, not 0.5"),
        (["sensor.row_time=20 ns", "sensor.pixel=asynchronous"],
         "sensor.row_time must be given with sensor.pixel = latched"),
        (["sensor.pixel=continuous", "sensor.continuous.height=20", "sensor.height=30"],
         "sensor.height must be absent with sensor.continuous.height = 20"),
        (["sensor.pixel=asynchronous", "sensor.asynchronous.width=9000", "sensor.height=9000"],
         "must be at most 64,000,000 pixels"),
        (["sensor.source=serial:virtual", "sensor.width=32"],
         "sensor.width must be absent with sensor.source"),
    ],
)  # fmt: skip
def test_chips_that_cannot_be_built_are_one_line(refused, tmp_path, sets, said) -> None:
    words = [word for each in sets for word in ("--set", each)]
    assert said in refused("run", "step", *words, "--out", tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_the_clock_that_is_named_works() -> None:
    with pytest.raises(InputError, match=r"at most (\S+) Hz") as caught:
        camera("sensor.row_time=30 ns", "sensor.height=777", "sensor.clock=100 kHz")
    hertz = float(str(caught.value).split("at most ")[1].split(" Hz")[0])
    found = camera("sensor.row_time=30 ns", "sensor.height=777", f"sensor.clock={hertz} Hz")
    assert 0.99999 < found.row_skew <= 1


@pytest.mark.slow
@pytest.mark.parametrize("readout", ["asynchronous", "continuous"])
def test_other_readouts_have_the_size_as_well(viform, tmp_path, readout) -> None:
    words = [f"sensor.pixel={readout}", "sensor.width=9", "sensor.height=5", "duration=2 ms",
             "scene.at=1 ms", "sensor.quantum_efficiency=0.5"]  # fmt: skip
    sets = [word for each in words for word in ("--set", each)]
    answer = viform("run", "step", *sets, "--json", "--out", tmp_path / "run")
    assert answer.code == 0 and json.loads(answer.out)["outcome"] == "ok"
    report = (tmp_path / "run" / "report.html").read_text()
    assert "<td>9 x 5</td><td>given by the user</td>" in report


@pytest.mark.parametrize("kind", ["film", "star", "wave", "shockwave"])
@pytest.mark.parametrize(
    "shape", [(1, 7), *(pytest.param(s, marks=pytest.mark.slow) for s in ((1, 1), (9, 2003)))]
)
def test_drawn_scenes_fit_any_array(kind, shape) -> None:
    """The drawing of the nearest size, at the same places; limits of its sketch hold its light."""
    scenario = load(kind)[1]
    clock = Clock(40_000)
    grid = SceneGrid(shape, clock, 40)
    source = scenario.scene.source(grid)  # type: ignore[union-attr]
    near = tuple(min(max(n, 8), 2000) for n in shape)
    drawn = scenario.scene.source(replace(grid, shape=near))  # type: ignore[union-attr]
    assert source.shape == shape and drawn.shape == near
    rows, columns = (
        ((np.arange(n) + 0.5) * m / n).astype(int) for n, m in zip(shape, near, strict=True)
    )
    ps = clock.middle(20)
    np.testing.assert_array_equal(source.truth(ps), drawn.truth(ps)[np.ix_(rows, columns)])
    found = survey(scenario.scene.source(grid), clock, 40)  # type: ignore[union-attr]
    light = source.step(None, Block(0, 40))
    for piece in light.pieces:
        for plane in (piece.first, piece.last):
            assert plane.shape == shape and (plane >= found.least - 1).all()
            assert (plane <= found.most + 1).all()
    for row, column, _ in source.points():
        assert 0 <= row < shape[0] and 0 <= column < shape[1]


@pytest.mark.parametrize(
    ("size", "device"),
    [
        ((1, 1), None),
        *(
            pytest.param(size, device, marks=pytest.mark.slow)
            for size in ((1, 1), (1, 7), (7, 1), (17, 33), (3, 700)) for device in ("numba", None)
        ),
    ],
)  # fmt: skip
def test_small_chips_run_with_report_and_images(viform, tmp_path, size, device) -> None:
    sets = [f"sensor.width={size[1]}", f"sensor.height={size[0]}", "duration=1.1 ms",
            "image.at=[22]"]  # fmt: skip
    words = [word for each in sets for word in ("--set", each)]
    chosen = [] if device is None else ["--device", device]
    answer = viform("run", "film", *words, *chosen, "--json", "--out", tmp_path / "run")
    assert answer.code == 0, answer.err
    result = json.loads(answer.out)
    assert result["outcome"] == "ok" and result["error"]["value"] < 1e-3
    ssim = result["metrics"]["tfp_ssim"]["value"]
    assert (ssim is None) == (min(size) < 11)
    assert (tmp_path / "run" / "images" / "tfp-00022.png").stat().st_size > 50
    assert (tmp_path / "run" / "report.html").stat().st_size > 10_000
