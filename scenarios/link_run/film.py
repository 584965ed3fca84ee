"""The chain of a link's run: air, chip and recorder, block by block."""

from __future__ import annotations

import errno
import hashlib
from pathlib import Path
from typing import Any

from cosim import Checkpoint, InputError, run_blocks
from cosim.files import Recorder
from scenarios.filming import CHECKPOINT, mend
from scenarios.folder import begin_folder
from scenarios.link_run.prepare import PreparedLink
from scenarios.loading import to_toml
from scenarios.progress import Progress
from scenarios.result import Throughput, viform_version

__all__ = ["STREAM", "film_link"]

STREAM = "stream.zarr"
"""The recording's name in a run's folder."""


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
    camera, cycles, store = run.setting.camera, run.cycles, folder / STREAM
    air = run.make_air()
    sensor = run.make_camera(air.late)
    recorder = Recorder(store, sensor.shape, cycles, camera.clock)
    stages: dict[str, Any] = {"air": air, "sensor": sensor, "recorder": recorder}
    checkpoint = Checkpoint(folder / CHECKPOINT, _identity(run))
    if resume and checkpoint.load(stages) and not store.is_dir():  # refuses before it overwrites
        raise InputError("--resume", "given with the run's stream.zarr", "without", "leave it out")
    begin_folder(folder, to_toml(run.scenario))
    for note in run.notes:
        progress.note(note)
    chip = camera.chip
    progress.start(f"{run.name}: {cycles} cycles of {chip.width} x {chip.height}", cycles)
    try:
        seconds = run_blocks(
            stages, cycles, checkpoint=checkpoint, resume=resume, progress=progress.advance,
            mend=mend(folder),
        )  # fmt: skip
        checkpoint.save(cycles, stages)
    except OSError as exc:
        if exc.errno not in (errno.ENOSPC, errno.EDQUOT, errno.EFBIG):
            raise
        raise InputError(
            "--out", "where there is room for the stream", f"{folder} ({exc.strerror})",
            f"make room, then {mend(folder)}",
        ) from exc  # fmt: skip
    if resume:
        return seconds, []
    pixels = chip.width * chip.height
    return seconds, [
        Throughput("air", run.sent.planes / seconds["air"], "planes/s"),
        Throughput("sensor", cycles * pixels / seconds["sensor"], "pixel-cycles/s"),
        Throughput("recorder", recorder.bytes_written * 8 / seconds["recorder"], "bit/s"),
    ]
