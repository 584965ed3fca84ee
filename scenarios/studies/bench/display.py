"""Throughput of the display's renderer, against a GL renderer with one draw call for each plane,
and of whole chains: camera to display, and camera, link and display.

The stream has the rates of the picture in the sensor benchmark. The observer is a fixed eye (a
pursuing eye in display.pursuit). Every timed call includes the transfer of its image to the host.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final, Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from cosim.clock import Clock
from cosim.compute.opencl import Device
from cosim.errors import Interrupted
from cosim.run.machine import Options
from cosim.run.progress import QuietProgress
from cosim.run.timing import BRIGHT, DARK, REAL_TIME, REPEATS, TimingRow, least_of
from cosim.spikes.viform import WORD
from display import FixedEye, PlaneByPlane, PursuingEye, SpikePanel, make_renderer, panel_views
from scenarios.assemble.behind.machine import ChainMachine
from scenarios.assemble.machine import assemble
from scenarios.assemble.schema.loading import load
from sensor import CHIPS

CYCLES = 512
"""Number of planes in a timed call."""
PLAIN_CYCLES = 16
"""Number of planes in a timed call of the plain renderer."""
BATCH = 64
"""Number of planes in a span for the still eye."""
PURSUED = 8
"""Number of planes in a span for the pursuing eye, which moves 0.8 pixels in this time."""
SPEED = 4000.0
"""Speed of the pursuing eye, pixels/s."""
Kind = Literal["impulse", "hold", "causal", "pursuit"]
KINDS: tuple[Kind, ...] = ("impulse", "hold", "causal", "pursuit")
LOOPS: Final[dict[str, tuple[str, ...]]] = {
    "loop.glass": ("glass",), "loop.glass-over-light": ("glass-over-light",),
}  # fmt: skip
"""Scenario, and values of --set, by the name of the row."""
DURATION: Final = "16 ms"
"""Duration of light: a part of the shipped scenarios, whose cost grows with the time."""
WARM: Final = "2 ms"
"""Duration of a run before those that are timed, which builds kernels and shaders for all. No
shorter than the window of an image."""


def _words(cycles: int, shape: tuple[int, int]) -> npt.NDArray[np.uint32]:
    """Words of a picture without edges; every pixel fires regularly at its rate."""
    rate = np.linspace(DARK, BRIGHT, shape[0] * shape[1], dtype=np.float32).reshape(shape)
    phase = np.random.default_rng(1).random(shape, dtype=np.float32)
    words = np.zeros((-(-cycles // WORD), *shape), np.uint32)
    for cycle in range(cycles):
        phase += rate
        fired = phase >= 1
        phase -= fired
        words[cycle // WORD] |= fired.astype(np.uint32) << np.uint32(cycle % WORD)
    return words


def _planes_a_second(
    kind: Kind, words: npt.NDArray[np.uint32], shape: tuple[int, int]
) -> tuple[float, float]:
    """Throughput of our renderer and of the plain one, planes/s."""
    clock, moves = Clock.from_hz(REAL_TIME), kind == "pursuit"
    panel = SpikePanel(shape, clock, BRIGHT, "impulse" if kind == "pursuit" else kind)
    batch, end = PURSUED if moves else BATCH, clock.edge(CYCLES)
    eye = FixedEye((end // 2,), panel.luminance, 0, end)
    observer = PursuingEye(eye, (0.0, SPEED)) if moves else eye
    views = panel_views(observer, panel, 0, CYCLES, batch)
    bits = [(words[0] >> np.uint32(n)) & np.uint32(1) for n in range(PLAIN_CYCLES)]
    planes = np.stack(bits).astype(np.uint8)
    ours, plain = make_renderer("auto", panel, batch, 1), PlaneByPlane(kind, shape)

    def show() -> npt.NDArray[np.float64]:
        ours.step(words, CYCLES, views)
        return ours.take(0)

    try:
        spent = least_of([show, lambda: plain.show(planes, SPEED / REAL_TIME)], REPEATS)
    finally:
        ours.close()
        plain.close()
    return CYCLES / spent[0], PLAIN_CYCLES / spent[1]


def display_rows(device: Device | None, ceiling: float | None) -> list[TimingRow]:
    """The rows `display.*`, at the size of SpikeTwo.

    Args:
        device: OpenCL device; not used.
        ceiling: measured ceiling, pixel-cycles/s, None if unknown.
    """
    shape = CHIPS["spiketwo"].height, CHIPS["spiketwo"].width
    words, rows = _words(CYCLES, shape), []
    for kind in KINDS:
        value, plain = _planes_a_second(kind, words, shape)
        share = value * shape[0] * shape[1] / ceiling if ceiling else None
        rows.append(
            TimingRow(f"display.{kind}", "exact", value, "planes/s", value / REAL_TIME, share,
                value / plain)
        )  # fmt: skip
    return rows


def loop_rows(device: Device | None, ceiling: float | None) -> list[TimingRow]:
    """A row for each chain, one for its processor time and one for each of its stages alone.

    The chain of the plan runs from its first to its last block, with the recording, without the
    report. The stages work at the same time; the plain way is one after another. The value of a
    stage is what it would reach if it had nothing to wait for, so the slowest stage is the one with
    the smallest; its share is of the time of all stages. Processor time is that of the parallel
    run, all cores together, and depends least on what else the machine does.

    Args:
        device: OpenCL device, None for the compiled form.
        ceiling: ceiling of the machine; chains have none.
    """
    rows = []
    for name, (scenario, *sets) in LOOPS.items():
        _run(scenario, device, sets, WARM, parallel=True)
        ran = _run(scenario, device, sets, DURATION, parallel=True)
        plain = _run(scenario, device, sets, DURATION, parallel=False).seconds
        rows.append(_row(name, "chain", ran, ran.seconds, plain / ran.seconds))
        rows.append(
            TimingRow(f"{name}.processor", "all cores", ran.processor_s, "s", None, None, None)
        )
        whole = sum(ran.stages.values())
        rows += [
            _row(f"{name}.{stage}", "stage", ran, took, None, took / max(whole, 1e-9))
            for stage, took in ran.stages.items()
        ]
    return rows


class _Ran(NamedTuple):
    """A chain that has run: seconds of each stage, of the whole and of processor time; cycles of
    the scene, and how many a second it has, Hz."""

    stages: dict[str, float]
    seconds: float
    processor_s: float
    cycles: int
    hz: float


def _row(
    name: str, tier: str, ran: _Ran, seconds: float, plain: float | None, share: float | None = None
) -> TimingRow:
    value = ran.cycles / max(seconds, 1e-9)
    return TimingRow(name, tier, value, "planes/s", value / ran.hz, None, plain, share)


def loop_machine(
    scenario: str, device: Device | None, sets: Sequence[str], duration: str
) -> ChainMachine:
    """The chain of a run of `bench loop`, to be closed."""
    name, loaded = load(scenario, [*sets, f"duration={duration}"])
    options = Options("numba" if device is None else str(device.number))
    machine = assemble(name, loaded, options, QuietProgress())
    assert isinstance(machine, ChainMachine)
    return machine


def _run(
    scenario: str, device: Device | None, sets: Sequence[str], duration: str, *, parallel: bool
) -> _Ran:
    """The time of a chain that fails to keep its plan is that of its last try."""
    machine = loop_machine(scenario, device, sets, duration)
    try:
        with TemporaryDirectory() as folder:
            chain: Any = machine.chain(Path(folder))
            chain.parallel = parallel
            begin, worked = time.perf_counter(), time.process_time()
            spent = chain.run(QuietProgress())
            seconds, processor_s = time.perf_counter() - begin, time.process_time() - worked
        return _Ran(spent, seconds, processor_s, machine.feed.cycles, machine.feed.clock.hz)
    except Interrupted as exc:  # its advice is to go on in a folder that is gone
        raise KeyboardInterrupt from exc
    finally:
        machine.close()
