"""The peak memory that a run states, against the peak that it has."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import pytest

from scenarios.assemble.schema.loading import load
from scenarios.assemble.source.latched.memory import memory_note, peak_memory
from scenarios.assemble.source.latched.setup import set_up_camera

MEASURED = (
    "import resource, sys\n"
    "from scenarios.cli.entry import _main\n"
    "code = _main(sys.argv[1:])\n"
    "print(code, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)\n"
)
SHORT = ("duration=0.2 ms", "image.window=7", "image.at=[4]")


def peak_of_run(scenario: str, sets: tuple[str, ...], out: Path) -> int:
    """Peak memory of a run with its report, bytes."""
    command = [sys.executable, "-c", MEASURED, "run", scenario, *words(*sets), "--json",
               "--out", str(out)]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=dict(os.environ))
    code, kilobytes = done.stdout.splitlines()[-1].split()
    assert code == "0"
    return int(kilobytes) * 1024


def words(*sets: str) -> list[str]:
    return [word for each in sets for word in ("--set", each)]


def test_the_memory_is_stated_and_refused_before_the_run(
    viform, refused, tmp_path, monkeypatch
) -> None:
    small = words("sensor.width=40", "sensor.height=20", "duration=1.1 ms", "image.at=[20]")
    assert "a run needs about 0.43 GiB of memory" in viform("plan", "step", *small).out
    free = SimpleNamespace(available=2**33)
    monkeypatch.setattr("cosim.compute.memory.psutil.virtual_memory", lambda: free)
    large = words("sensor.width=8000", "sensor.height=8000", *SHORT)
    for command in (("run", "step", *large, "--out", tmp_path / "x"), ("plan", "step", *large)):
        said = refused(*command)
        assert said.startswith(
            "the memory of this run must be small enough for the 8 GiB of memory"
        )
        assert "GiB; lower sensor.width and sensor.height" in said
    assert not (tmp_path / "x").exists()


def test_more_instants_and_moving_light_need_more() -> None:
    def needs(*sets: str, planes: float = 0.0, device: str | None = "numba") -> int:
        scenario = load("film", ["sensor.width=1000", "sensor.height=1000", *sets])[1]
        return peak_memory(set_up_camera(scenario, device), planes)  # type: ignore[arg-type]

    one, five = needs("image.at=[50]"), needs()
    assert five > one and needs("image.at=[50]", planes=0.1) > one
    assert "1000 x 1000 pixels" in memory_note(
        set_up_camera(load("film")[1], "numba"),
        0.1,  # type: ignore[arg-type]
    )


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scenario", "sets"),
    [
        ("step", ("sensor.width=2000", "sensor.height=2000", *SHORT)),
        ("step", ("sensor.width=2000", "sensor.height=2000", "duration=0.2 ms", "image.window=7")),
        ("film", ("sensor.width=2000", "sensor.height=1500", "duration=3.2 ms", "image.at=[60]")),
        ("glass", ("sensor.width=1200", "sensor.height=1000", "duration=3.2 ms", "image.at=[60]")),
        ("step", ("sensor.width=8000", "sensor.height=8000", *SHORT)),
        ("film", ("duration=300 ms",)),
        ("film", ("sensor.chip=spikeone", "duration=800 ms")),
    ],
)  # fmt: skip
def test_runs_need_what_they_state(tmp_path: Path, scenario: str, sets: tuple[str, ...]) -> None:
    setup = set_up_camera(load(scenario, list(sets))[1], None)  # type: ignore[arg-type]
    stated = peak_memory(setup, setup.survey.light.planes)
    assert peak_of_run(scenario, sets, tmp_path / "run") == pytest.approx(stated, rel=0.25)


@pytest.mark.slow
def test_a_film_of_four_seconds_needs_no_more_than_one_of_a_second(tmp_path: Path) -> None:
    plane = ("sensor.width=400", "sensor.height=250")
    one, four = (
        peak_of_run("film", (*plane, f"duration={n} s"), tmp_path / str(n)) for n in (1, 4)
    )
    assert four < 1.1 * one
