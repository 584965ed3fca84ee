"""The chain of a run: scene, lens, check, chip, recorder and display, gone through until every
promise holds."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from functools import partial
from pathlib import Path
from shutil import rmtree
from typing import Any

from cosim import Block, Checkpoint, InputError, Light, run_blocks
from cosim.files import Recorder
from cosim.files.whole import whole
from cosim.light.lens import Lens
from cosim.light.source import Source
from cosim.run.folder import begin_folder, mend, room_for
from cosim.run.progress import Progress
from cosim.run.result import Throughput, dumps
from scenarios.assemble.checked import shortfall
from scenarios.assemble.loading import to_toml
from scenarios.assemble.prepare import Prepared, again, identity
from scenarios.assemble.verifier import BrokenPromise, Finding

__all__ = [
    "CHECKPOINT", "PUT_BACK", "STREAM", "Filmed", "WiderStage", "film_as_promised", "run_recorded",
]  # fmt: skip

CHECKPOINT = "checkpoint.npz"
"""In a run's folder while it is not finished."""
STREAM = "stream.zarr"
"""The recording's name in a run's folder."""
PUT_BACK = "put_back.json"
"""Beside it where a promise was broken."""


@dataclass(frozen=True, eq=False)
class Filmed:
    """A run whose stream is whole. seconds: of every stage. throughput: none where only a part was
    run now. put_back: effects that a broken promise has put back. save: writes the checkpoint of
    its end, which only one that does not get to its report needs."""

    run: Prepared
    seconds: dict[str, float]
    throughput: list[Throughput]
    put_back: list[Finding]
    save: Callable[[], None]


class WiderStage:
    """The scene, asked for a little more than the block: a camera whose rows are sampled before or
    after the clock's edge needs the light around it."""

    def __init__(self, source: Source, reach: tuple[int, int]) -> None:
        self._source, self._reach = source, reach

    def step(self, given: None, block: Block) -> Light:
        before, after = self._reach
        start = max(block.start - before, 0)
        return self._source.step(given, Block(start, block.stop + after - start))


class RelayStage:
    """The lens as a stage."""

    def __init__(self, lens: Lens, pitch_um: float) -> None:
        self._relay = lens.relay(pitch_um)

    def step(self, given: Light, block: Block) -> Light:
        return self._relay(given)


def run_recorded(
    name: str, stages: Mapping[str, Any], cycles: int, identity: str, folder: Path, scenario: str,
    notes: Iterable[str], resume: bool, progress: Progress, every_s: float = 30.0,
    keep: bool = True,
) -> dict[str, float]:  # fmt: skip
    """Runs a chain that ends in the folder's STREAM, from its checkpoint where `resume` finds one;
    seconds of every stage. identity: of the run's inputs. scenario: as TOML. every_s: between
    checkpoints. keep: whether there is one of the end as well."""
    checkpoint = Checkpoint(folder / CHECKPOINT, identity)
    begin = checkpoint.load(stages) if resume else 0
    if begin and not (folder / STREAM).is_dir():
        # refused before anything is overwritten
        raise InputError("--resume", "given with the run's stream.zarr", "without", "leave it out")
    begin_folder(folder, scenario)
    for note in notes:
        progress.note(note)
    height, width = stages["sensor"].shape
    progress.start(f"{name}: {cycles} cycles of {width} x {height}", cycles)
    with room_for("the stream", folder):
        seconds = run_blocks(
            stages, cycles, checkpoint=checkpoint, begin=begin, progress=progress.advance,
            every_s=every_s, mend=mend(folder),
        )  # fmt: skip
        if keep:
            checkpoint.save(cycles, stages)
    return seconds


def _film(run: Prepared, folder: Path, resume: bool, progress: Progress) -> Filmed:
    """Runs the chain."""
    chip, clock, cycles = run.setting.chip, run.setting.clock, run.cycles
    recorder = Recorder(folder / STREAM, run.camera.shape, cycles, clock)
    stages: dict[str, Any] = {
        "scene": WiderStage(run.source, run.setting.reach),
        "lens": RelayStage(run.lens, chip.pitch),
        **({} if run.verifier is None else {"check": run.verifier}),
        "sensor": run.camera,
        "recorder": recorder,
        **({} if run.boards.panel is None else {"sink": run.boards.panel}),
    }
    if run.glass is not None:
        stages = run.glass.stages(stages)
    named = identity(run.scenario, run.plan, run.glass)
    seconds = run_recorded(
        run.name, stages, cycles, named, folder,
        to_toml(run.scenario), [*run.notes, *run.source.notes], resume, progress,
        every_s=30.0 if run.glass is None else 60.0,  # what was seen so far is half a gigabyte
        keep=False,
    )  # fmt: skip
    save = partial(Checkpoint(folder / CHECKPOINT, named).save, cycles, stages)
    if resume:
        return Filmed(run, seconds, [], [], save)
    rate = cycles * chip.width * chip.height / seconds["sensor"]
    bits = recorder.bytes_written * 8 / seconds["recorder"]
    throughput = [
        Throughput("sensor", rate, "pixel-cycles/s"),
        Throughput("recorder", bits, "bit/s"),
    ]
    if run.glass is not None:
        throughput.append(Throughput("display", cycles / seconds["display"], "planes/s"))
    return Filmed(run, seconds, throughput, [], save)


def _put_back_before(path: Path) -> list[Finding]:
    """What the run that is gone on with has put back so far."""
    if not path.exists():
        return []
    try:
        return [Finding(**found) for found in json.loads(path.read_text(encoding="utf-8"))]
    except (OSError, ValueError, TypeError) as exc:
        raise InputError(
            PUT_BACK, "the one that this run wrote", "a damaged file",
            f"remove {path.parent} and run it afresh",
        ) from exc  # fmt: skip


def film_as_promised(run: Prepared, folder: Path, resume: bool, progress: Progress) -> Filmed:
    """Films, and films again with an effect put back as long as a promise is broken."""
    kept = folder / PUT_BACK
    resume = resume and (folder / CHECKPOINT).exists()  # else it starts afresh
    found = _put_back_before(kept) if resume else []
    if found:
        run = again(run, [f.effect for f in found])
    while True:
        try:
            filmed = _film(run, folder, resume, progress)
            new = shortfall(run.plan, run.verifier)
        except BrokenPromise as exc:
            new = exc.findings
        if not new:
            return replace(filmed, put_back=found)
        found += new
        for finding in new:
            progress.note(finding.told)
        (folder / CHECKPOINT).unlink(missing_ok=True)
        rmtree(folder / STREAM, ignore_errors=True)
        with whole(kept) as part:
            part.write_text(dumps([asdict(f) for f in found]), encoding="utf-8")
        run, resume = again(run, [f.effect for f in found]), False
