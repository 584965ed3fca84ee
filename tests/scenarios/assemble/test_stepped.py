"""Runs without a common clock, interrupted and resumed: the same bits, the same metrics."""

from __future__ import annotations

import os
import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cosim import InputError, Interrupted
from sensor.asynchronous.readout.recorder import Output
from sensor.continuous import machine as continuous

CASES = {
    "asynchronous": ("sensor.pixel=asynchronous", "sensor.asynchronous.change=2"),
    "channel": ("sensor.pixel=asynchronous", "sensor.channel.rate=2 MHz"),
    "stamped late": (
        "sensor.pixel=asynchronous", "sensor.channel.rate=2 MHz",
        "sensor.channel.timestamp=channel", "sensor.channel.arbitration=round-robin",
    ),
    "continuous": ("sensor.pixel=continuous",),
}  # fmt: skip
SMALL = ("sensor.chip=spikeone", "duration=8 ms")
SINKS = {"asynchronous": Output, "continuous": continuous._Sink}


def content(folder: Path) -> dict[str, Any]:
    (stream,) = folder.glob("stream.*")
    with np.load(stream) as arrays:
        return {name: arrays[name].tobytes() for name in arrays.files}


@pytest.mark.parametrize("case", CASES)
def test_an_interrupted_run_goes_on_to_the_same_bits(film, tmp_path, monkeypatch, case):
    sets = (*SMALL, *CASES[case])
    whole, _ = film("film", tmp_path / "whole", *sets)
    sink = SINKS.get(case, Output)
    step, steps = sink.step, []

    def interrupted(self: Any, value: Any, start: int, stop: int) -> None:
        steps.append(stop)
        if len(steps) in (2, 3):
            os.kill(os.getpid(), signal.SIGINT)
        step(self, value, start, stop)

    monkeypatch.setattr(sink, "step", interrupted)
    folder = tmp_path / "run"
    for cycles in (128, 192):  # a step has 64
        with pytest.raises(Interrupted, match=f"after {cycles} of 320 cycles; go on with") as found:
            film("film", folder, *sets, resume=folder.exists())
        assert "--resume" in str(found.value) and (folder / "checkpoint.npz").exists()
        assert not (folder / "result.json").exists()
    again, _ = film("film", folder, *sets, "title=another", resume=True)
    assert len(steps) == 5  # none was done twice
    assert content(folder) == content(tmp_path / "whole")
    names = ("camera", "full_physics")  # these are times
    assert {k: v for k, v in again.metrics.items() if k not in names} == {
        k: v for k, v in whole.metrics.items() if k not in names
    }
    assert again.error == whole.error and again.left_out == whole.left_out
    assert {p.name for p in folder.iterdir()} == {p.name for p in (tmp_path / "whole").iterdir()}


@pytest.mark.parametrize("case", ["channel", "continuous"])
def test_an_interrupt_in_the_report_loses_nothing(film, tmp_path, case):
    def stop(machine: Any, run: Any) -> list[str]:
        raise KeyboardInterrupt

    sets = (*SMALL, *CASES[case])
    whole, _ = film("film", tmp_path / "whole", *sets)
    with pytest.raises(Interrupted, match="after 320 of 320 cycles"):
        film("film", tmp_path / "run", *sets, report=stop)
    assert not (tmp_path / "run" / "report.html").exists()
    again, _ = film("film", tmp_path / "run", *sets, resume=True)
    assert content(tmp_path / "run") == content(tmp_path / "whole")
    assert again.metrics["tfi_psnr" if case == "channel" else "continuous_psnr"] is not None
    assert again.metrics.keys() == whole.metrics.keys()


def test_a_second_interrupt_ends_a_step_at_once(film, tmp_path, monkeypatch):
    def interrupted(self: Any, value: Any, start: int, stop: int) -> None:
        for _ in range(2):
            os.kill(os.getpid(), signal.SIGINT)

    monkeypatch.setattr(Output, "step", interrupted)
    with pytest.raises(Interrupted, match="after 0 of 320 cycles"):
        film("film", tmp_path / "run", *SMALL, *CASES["channel"])
    assert sorted(p.name for p in (tmp_path / "run").iterdir()) == ["scenario.toml"]


def test_a_checkpoint_of_another_plan_is_refused(film, tmp_path, monkeypatch):
    monkeypatch.setattr(Output, "step", lambda *_: os.kill(os.getpid(), signal.SIGINT))
    sets = (*SMALL, *CASES["asynchronous"])
    with pytest.raises(Interrupted):
        film("film", tmp_path / "run", *sets)
    monkeypatch.undo()
    monkeypatch.setattr("sensor.asynchronous.machine.viform_version", lambda: "another")
    with pytest.raises(InputError, match="the checkpoint must be one of this same scenario"):
        film("film", tmp_path / "run", *sets, resume=True)
