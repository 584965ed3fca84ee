"""A step of light in the scene, watched until the display has gone half way, against the stages."""

from __future__ import annotations

import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from cosim import PS, Viform
from cosim.files import ZarrStream
from cosim.run.machine import Options
from cosim.run.shown import SilentProgress
from cosim.spikes.viform import words_for
from display.probes import metrics
from display.probes.waveform import panel_light
from display.quality.edges import half_way, risen
from scenarios.assemble.behind.link.judged import _latency
from scenarios.assemble.behind.link.stream_link import RECEIVED
from scenarios.assemble.behind.machine import ChainMachine
from scenarios.assemble.machine import assemble
from scenarios.assemble.schema.messages import validate
from scenarios.run import run_scenario

AT = 4.5125
"""Instant of the step, ms: the middle of a cycle, so the mean over phases is that of the probes."""


def scenario(rate: float) -> Any:
    """A step from the dark to `rate` spikes a cycle before the whole chain."""
    length, height = (20, 256) if rate < 0.1 else (10, 64)  # dim light needs many pixels
    return validate({
        "title": "a step", "duration": f"{length} ms", "image": {"at": [300]},
        "scene": {
            "kind": "step", "illuminance": "700 lux", "before": 0, "after": 1, "at": f"{AT} ms",
        },
        "sensor": {
            "width": 96, "height": height, "chip": "spiketwo", "clock": "40 kHz",
            "threshold": "1000 e", "lens": {"white_rate": rate},
        },
        "code": {"cycles": 64, "tile": 32, "buffer": "1 ms"},
        "link": {
            "panel": {"width": 192, "height": 192},
            "modem": {"cell": 2, "ticks": 2, "line": "8b10b", "parity": 16},
            "sensor": {"chip": "spikeone", "threshold": "1000 e", "reset": "hard"},
        },
        "display": {"drive": "causal", "renderer": "numpy", "beside": [], "projector": "none"},
    })  # fmt: skip


def made(rate: float) -> ChainMachine:
    machine = assemble("step", scenario(rate), Options(), SilentProgress())
    assert isinstance(machine, ChainMachine)
    return machine


def watched(machine: ChainMachine, folder: Path) -> tuple[float, float]:
    """Typical time from the step until the light of a pixel has gone half way, us, and its standard
    error; of the brightest of the eight bars."""
    assert machine.behind.screen is not None and machine.behind.link is not None
    panel, clock = machine.behind.screen.chain.panel, machine.feed.clock
    stream = ZarrStream(folder / RECEIVED)
    words = stream.read_words(0, words_for(stream.cycles))
    viform = Viform(words, stream.cycles, stream.clock)
    light = panel_light(viform, panel, panel.drive)
    bright = np.tile(np.arange(stream.shape[1]) >= stream.shape[1] * 7 // 8, stream.shape[0])
    half = half_way(0.0, float(light[len(light) * 3 // 4 :, bright].mean()))
    starts = np.array([panel.start(n) for n in range(len(light) + 1)], np.float64)
    row = np.repeat(np.arange(panel.shape[0]), panel.shape[1]) * (panel.row_delay / panel.shape[0])
    when = risen(starts, light, half, panel.rise * PS, panel.decay * PS) + row
    shown = (when[bright] - AT * PS / 1e3) / PS * 1e6 + machine.behind.link.hold / clock.hz * 1e6
    # A median of times in whole planes is one of them; the mean of their middle half is not.
    order = np.sort(shown[np.isfinite(shown)])
    middle = order[len(order) // 4 : -len(order) // 4]
    return float(middle.mean()), float(order.std() / np.sqrt(order.size))


@pytest.fixture(scope="module")
def stated(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """The folder and the result of a whole run with a step to grey."""
    folder = tmp_path_factory.mktemp("grey") / "run"
    done = run_scenario(
        "step", scenario(metrics.GREY), folder, options=Options(), progress=SilentProgress(),
        began=time.perf_counter(), report=lambda machine, run: [],
    )  # fmt: skip
    return folder, done.result.document()


@pytest.mark.parametrize("distance", [2.0, 20_000.0])
def test_no_stage_takes_less_than_no_time_and_their_sum_is_the_hold(distance: float) -> None:
    """Light that is on its way for less than a tick is seen in the tick in which it is sent."""
    period, group, lead, hold = 25e6, 64, 96, 98  # ps, then cycles
    setup = SimpleNamespace(
        lead=lead, block_cycles=8.0, block_until=lambda tick: tick // 8 - 2,
        first_cycle=lambda block: 8 * (block + 1),
        setting=SimpleNamespace(air=SimpleNamespace(distance=distance)),
    )  # fmt: skip
    end = 128
    link: Any = SimpleNamespace(setup=setup, hold=hold, group=group)
    far: Any = SimpleNamespace(arrivals=[(lead + end + 16, 500, end)] * 9)
    rows = _latency(link, far, period)
    assert [row.stage for row in rows][3:5] == ["air", "link chip"]
    assert all(row.min_us >= 0 for row in rows), rows
    assert sum(row.median_us for row in rows) == pytest.approx(hold * 25, abs=1e-6)
    flight = distance / 299_792_458 * 1e6
    assert rows[3].median_us == pytest.approx(flight, rel=1e-3)


@pytest.mark.slow
def test_stages_add_up_to_the_step_that_is_watched(stated: tuple[Path, dict[str, Any]]) -> None:
    document = stated[1]
    stages = {row["stage"]: row["median_us"] for row in document["latency"]}
    whole = document["metrics"]["latency_photon_us"]["value"]
    assert abs(sum(stages.values()) - whole) < 25


@pytest.mark.slow
@pytest.mark.parametrize("rate", [metrics.DIM, metrics.GREY, metrics.WHITE])
def test_a_step_through_the_whole_chain_is_seen_when_stated(
    stated: tuple[Path, dict[str, Any]], tmp_path: Path, rate: float
) -> None:
    machine = made(rate)
    folder = stated[0]
    if rate != metrics.GREY:
        folder = tmp_path
        machine.chain(folder).run(SilentProgress())
    seen, error = watched(machine, folder)
    machine.close()
    name = f"latency_photon_{metrics.NAMES[rate]}_us"
    assert abs(seen - stated[1]["metrics"][name]["value"]) < 25 + 3 * error  # a plane
    assert error < 12
