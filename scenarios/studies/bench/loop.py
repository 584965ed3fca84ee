"""Throughput of whole chains: camera to display, and camera, link and display."""

from __future__ import annotations

import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

from cosim.compute.opencl import Device
from cosim.errors import Interrupted
from cosim.run.machine import Options
from cosim.run.progress import QuietProgress
from cosim.run.timing import Row
from scenarios.assemble.behind.machine import ChainMachine
from scenarios.assemble.machine import assemble
from scenarios.assemble.schema.loading import load

LOOPS: Final[dict[str, tuple[str, ...]]] = {
    "loop.glass": ("glass",), "loop.glass-over-light": ("glass-over-light",),
}  # fmt: skip
"""Scenario, and values of --set, by the name of the row."""
DURATION: Final = "16 ms"
"""Duration of light: a part of the shipped scenarios, whose cost grows with the time."""
WARM: Final = "2 ms"
"""Duration of a run before those that are timed, which builds kernels and shaders for all. No
shorter than the window of an image."""


def loop_rows(device: Device | None, ceiling: float | None) -> list[Row]:
    """A row for each chain, and one for each of its stages alone.

    The chain of the plan runs from its first to its last block, with the recording, without the
    report. The stages work at the same time; the plain way is one after another. The value of a
    stage is what it would reach if it had nothing to wait for, so the slowest stage is the one with
    the smallest.

    Args:
        device: OpenCL device, None for the compiled form.
        ceiling: ceiling of the machine; chains have none.
    """
    rows = []
    for name, (scenario, *sets) in LOOPS.items():
        _run(scenario, device, sets, WARM, parallel=True)
        spent, seconds, simulated = _run(scenario, device, sets, DURATION, parallel=True)
        _, plain, _ = _run(scenario, device, sets, DURATION, parallel=False)
        cycles, hz = simulated
        rows.append(_row(name, "chain", cycles, seconds, hz, plain / seconds))
        rows += [
            _row(f"{name}.{stage}", "stage", cycles, took, hz, None)
            for stage, took in spent.items()
        ]
    return rows


def _row(name: str, tier: str, cycles: int, seconds: float, hz: float, plain: float | None) -> Row:
    value = cycles / max(seconds, 1e-9)
    return Row(name, tier, value, "planes/s", value / hz, None, plain)


def _run(
    scenario: str, device: Device | None, sets: list[str], duration: str, *, parallel: bool
) -> tuple[dict[str, float], float, tuple[int, float]]:
    """Seconds of each stage, seconds of the chain, and (cycles, cycles a second) of the scene.

    The time of a chain that fails to keep its plan is that of its last try.
    """
    name, loaded = load(scenario, [*sets, f"duration={duration}"])
    options = Options("numba" if device is None else str(device.number))
    machine = assemble(name, loaded, options, QuietProgress())
    try:
        with TemporaryDirectory() as folder:
            assert isinstance(machine, ChainMachine)
            chain: Any = machine.chain(Path(folder))
            chain.parallel = parallel
            begin = time.perf_counter()
            spent = chain.run(QuietProgress())
            seconds = time.perf_counter() - begin
        return spent, seconds, (machine.feed.cycles, machine.feed.clock.hz)
    except Interrupted as exc:  # its advice is to go on in a folder that is gone
        raise KeyboardInterrupt from exc
    finally:
        machine.close()
