"""The chain of a link's run: air, chip and recorder, block by block."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Any

from cosim.config.toml import to_toml
from cosim.files import Recorder
from cosim.run.chain import CHECKPOINT, STREAM, BlockChain
from cosim.run.folder import begin_folder
from cosim.run.progress import Progress
from cosim.run.result import Throughput, viform_version
from link.run.prepare import PreparedLink

__all__ = ["film_link"]


def _identity(run: PreparedLink) -> str:
    """Text that names a run's inputs."""
    text = to_toml(run.scenario.model_copy(update={"title": ""})) + viform_version()
    text += f"{run.mode} {run.plan.tier} {sorted(run.plan.left_out)}"
    text += hashlib.sha256(run.payload.data).hexdigest()
    return hashlib.sha256(text.encode()).hexdigest()


def film_link(
    run: PreparedLink, folder: Path, resume: bool, progress: Progress
) -> tuple[dict[str, float], list[Throughput]]:
    """Films the panel into the folder's stream; seconds of every stage, and throughput unless only
    a part was run now."""
    camera, cycles = run.setting.camera, run.cycles
    resume = resume and (folder / CHECKPOINT).exists()  # else it starts afresh
    air = run.make_air()
    sensor = run.make_camera(air.late)
    recorder = Recorder(folder / STREAM, sensor.shape, cycles, camera.clock)
    stages: dict[str, Any] = {"air": air, "sensor": sensor, "recorder": recorder}
    chip = camera.chip
    chain = BlockChain(
        f"{run.name}: {cycles} cycles of {chip.width} x {chip.height}", stages, cycles,
        _identity(run), folder,
    )  # fmt: skip
    if resume:
        chain.load()
    begin_folder(folder, to_toml(run.scenario))
    for note in run.notes:
        progress.note(note)
    seconds = chain.run(progress)
    chain.save()
    if resume:
        return seconds, []
    pixels = camera.chip.width * camera.chip.height
    return seconds, [
        Throughput("air", run.sent.planes / seconds["air"], "planes/s"),
        Throughput("sensor", cycles * pixels / seconds["sensor"], "pixel-cycles/s"),
        Throughput("recorder", recorder.bytes_written * 8 / seconds["recorder"], "bit/s"),
    ]
