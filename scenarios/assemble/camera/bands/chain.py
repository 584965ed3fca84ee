"""A run whose chip is simulated in bands of rows on workers.

Each band is simulated over the whole run and kept in the run's folder. Then the chain runs as ever,
with a camera that reads the bands. What is lost with a worker, or with an interruption, is a band.
"""

from __future__ import annotations

import hashlib
import json
import os
import time
from dataclasses import dataclass, replace
from pathlib import Path
from shutil import rmtree
from typing import Any, Final

import numpy as np

from cosim import Block, InputError, Interrupted, Light, Viform
from cosim.archive import save_array
from cosim.clock import Clock
from cosim.files.whole import whole
from cosim.plan.tiles import TILE
from cosim.run.chain import BlockChain
from cosim.run.folder import how_to_resume, room_for
from cosim.run.progress import Progress
from cosim.run.workers import workers_for
from cosim.spikes.viform import WORD, Words, words_for
from cosim.stage import State
from scenarios.assemble.camera.bands.band import Band, expose_band
from scenarios.assemble.camera.plan import RunPlan
from scenarios.assemble.camera.setup import CameraSetup
from scenarios.assemble.schema.scenario import Scenario
from sensor.latched.fine_tiles import FineTiles

FOLDER: Final = "bands"
"""Folder of the bands in that of a run that is not finished."""
MOST: Final = 1 << 26
"""Largest recording of a band, bytes."""
_STATED: Final = "bands.json"


@dataclass(frozen=True)
class Bands:
    """Who simulates the bands.

    Attributes:
        workers, scheduler: see `workers_for`.
        device: device as for `choose_device`.
    """

    workers: int
    scheduler: str | None
    device: str | None


def refuse_bands(scenario: Scenario) -> None:
    """Raises InputError for a camera whose rows cannot be simulated apart."""
    sensor = scenario.sensor
    for key, given, why in (
        ("sensor.sub_threshold", sensor.sub_threshold is not None, "charge stays in the workers"),
        ("a [link]", scenario.link is not None, "its camera follows the sender"),
        ("sensor.source", sensor.source is not None, "a board has all rows"),
    ):
        if given:
            raise InputError(
                "--workers and --scheduler", f"given without {key}", f"with it, because {why}",
                "leave one out",
            )  # fmt: skip


def band_rows(height: int, width: int, cycles: int, workers: int) -> list[tuple[int, int]]:
    """First row, and the one after the last, of each band: whole tiles, at least as many bands as
    workers if there are as many rows of tiles, and none with a recording above MOST."""
    tiles = -(-height // TILE)
    row_bytes = TILE * width * 4 * words_for(cycles)
    most = max(1, min(MOST // row_bytes, -(-tiles // workers)))
    return [(first * TILE, min((first + most) * TILE, height)) for first in range(0, tiles, most)]


class BandedCamera:
    """The stage of a camera whose bits workers have made.

    Args:
        setup, plan: the camera; tiles of a better tier are simulated here.
        bands: who simulates the others.
    """

    def __init__(self, setup: CameraSetup, plan: RunPlan, bands: Bands) -> None:
        self.shape = setup.shape
        self._setup, self._plan, self._bands = setup, plan, bands
        self._folder, self._identity = Path(FOLDER), ""
        self._rows: list[tuple[int, int]] = []
        self._open: list[Any] = []
        self._clock: Clock = setup.setting.clock
        self._fine: FineTiles | None = plan.fine_tiles(setup.device)

    def place(self, folder: Path, identity: str) -> None:
        """Sets the folder of the run, and the digest of all that the bits depend on."""
        self._folder, self._identity = folder / FOLDER, identity

    def make(self, progress: Progress) -> None:
        """Simulates the bands that are not in the folder. Raises InputError, Interrupted."""
        height, width = self.shape
        with workers_for(self._bands.workers, self._bands.scheduler) as pool:
            self._rows = band_rows(height, width, self._setup.cycles, pool.count)
            self._begin()
            left = {n: (self._band(rows),) for n, rows in enumerate(self._rows)
                    if not _is_sound(self._path(n))}  # fmt: skip
            count = len(self._rows)
            progress.start(f"{count} bands of up to {self._rows[0][1]} rows", count)
            done = count - len(left)
            progress.advance(done)
            try:
                for number, words in pool.run(expose_band, left):
                    with whole(self._path(number)) as part:
                        _write(part, words)
                    done += 1
                    progress.advance(done)
            except KeyboardInterrupt:
                remedy = how_to_resume(self._folder.parent)
                raise Interrupted(done, count, remedy, "bands") from None

    def _band(self, rows: tuple[int, int]) -> Band:
        plan, setup = self._plan, replace(self._setup, device=None)
        band = Band(rows, setup, plan.setting, plan.tier, None, self._bands.device)
        low, high = band.simulated
        flags = None if plan.flags is None else plan.flags[low:high]
        return replace(band, flags=flags)

    def _path(self, number: int) -> Path:
        return self._folder / f"{number:06}.npy"

    def _begin(self) -> None:
        """Creates the folder, or keeps that of the same bands."""
        stated = json.dumps({"identity": self._identity, "rows": self._rows})
        there = self._folder / _STATED
        if not there.exists() or there.read_text(encoding="utf-8") != stated:
            rmtree(self._folder, ignore_errors=True)
            self._folder.mkdir(parents=True)
            with whole(there) as part:
                part.write_text(stated, encoding="utf-8")

    def step(self, light: Light, block: Block) -> Viform:
        """The bits of one block; see `SpikeCamera.step`."""
        if not self._open:
            self._open = [np.load(self._path(n), mmap_mode="r") for n in range(len(self._rows))]
        first, stop = block.start // WORD, words_for(block.stop)
        words = np.concatenate([part[first:stop] for part in self._open], axis=1)
        if self._fine is not None:
            chip = words.reshape(len(words), -1)
            for numbers, some in self._fine.step(light, block.start, block.cycles):
                chip[:, numbers] = some
        return Viform(words, block.cycles, self._clock, block.start)

    def state(self) -> State:
        return {} if self._fine is None else self._fine.state()

    def restore(self, state: State) -> None:
        if self._fine is not None:
            self._fine.restore(state)

    def remove(self) -> None:
        """Removes the bands."""
        self._open = []
        rmtree(self._folder, ignore_errors=True)


def _write(path: Path, words: Words) -> None:
    """Writes a band as `.npy`, with the digest of the file behind the array."""
    with path.open("w+b") as file:
        save_array(file, words)
        file.seek(0)
        digest = hashlib.file_digest(file, "sha256").digest()
        file.seek(0, os.SEEK_END)
        file.write(digest)


def _is_sound(path: Path) -> bool:
    """Whether a band is there, as it was written."""
    if not path.exists():
        return False
    found = hashlib.sha256()
    left = path.stat().st_size - found.digest_size
    with path.open("rb") as file:
        while left > 0:
            part = file.read(min(left, 1 << 20))
            found.update(part)
            left -= len(part)
        return file.read() == found.digest()


@dataclass
class BandChain(BlockChain):
    """A chain whose stage `sensor` is a `BandedCamera`."""

    def run(self, progress: Progress) -> dict[str, float]:
        camera: BandedCamera = self.stages["sensor"]
        if self.begin >= self.cycles:  # resumed after its end: the bands have been read
            camera.remove()
            return super().run(progress)
        begin = time.perf_counter()
        with room_for("the bands of the chip", self.folder):
            camera.make(progress)
        made = time.perf_counter() - begin
        spent = super().run(progress)
        camera.remove()
        return spent | {"sensor": spent["sensor"] + made}

    def discard(self) -> None:
        super().discard()
        self.stages["sensor"].remove()
