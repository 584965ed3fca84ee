"""A run whose chip is simulated in bands of rows on workers.

Each band is simulated over the whole run and kept in the run's folder. Then the chain runs as ever,
with a camera that reads the bands. What is lost with a worker, or with an interruption, is a band.
"""

from __future__ import annotations

import hashlib
import json
import os
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from shutil import rmtree
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim import Block, InputError, Interrupted, Light, Piece, Plane, Viform
from cosim.archive import save_array
from cosim.clock import Clock
from cosim.compute.opencl import choose_device
from cosim.compute.pocl_files import keep_sums
from cosim.files.atomic import atomic_write
from cosim.light.source import Source
from cosim.plan.tiles import TILE
from cosim.run.chain import BlockChain
from cosim.run.folder import how_to_resume, room_for
from cosim.run.progress import Progress
from cosim.run.workers import workers_for
from cosim.spikes.viform import WORD, Words, words_for
from cosim.stage import BLOCK, State, blocks
from scenarios.assemble.schema.scenario import Scenario
from scenarios.assemble.source.latched.plan import RunPlan
from scenarios.assemble.source.latched.setup import CameraSetup
from sensor import CameraSetting, SpikeCamera
from sensor.latched.fine_tiles import FineTiles
from sensor.latched.tiers import Tier

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
                    with atomic_write(self._path(number)) as part:
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
            with atomic_write(there) as part:
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


HALO = 1
"""Rows around a band that are simulated as well where pixels share light (cross-talk)."""


@dataclass(frozen=True, eq=False)
class Band:
    """Rows of a planned camera.

    Attributes:
        rows: first row, and the one after the last.
        setup: the camera and its scene, without its device.
        setting: the planned camera.
        tier: its arithmetic.
        flags: flags of the fast tier for the rows with their halo, (rows, groups) uint8; None in
            another tier.
        device: device as for `choose_device`.
    """

    rows: tuple[int, int]
    setup: CameraSetup
    setting: CameraSetting
    tier: Tier
    flags: npt.NDArray[np.uint8] | None
    device: str | None

    @property
    def simulated(self) -> tuple[int, int]:
        """The rows with their halo."""
        if self.setting.light_map is None:
            return self.rows
        return max(self.rows[0] - HALO, 0), min(self.rows[1] + HALO, self.setup.shape[0])


def expose_band(band: Band) -> Words:
    """The words of the band over the whole run, (words, rows, W) uint32.

    The bits are those of the whole chip: a pixel keeps its number, and with it its noise.
    """
    setup, (low, high) = band.setup, band.simulated
    camera = SpikeCamera(
        band.setting, choose_device(band.device), (low, high), band.tier, band.flags
    )
    clock, reach = setup.setting.clock, setup.setting.reach
    strip = Strip(setup.source(), setup.lens.relay(setup.setting.chip.pitch), (low, high), reach)
    first, stop = (row - low for row in band.rows)
    words = np.zeros((words_for(setup.cycles), stop - first, setup.shape[1]), np.uint32)
    for block in blocks(setup.cycles, BLOCK):
        light = strip.step(block, clock.edge(max(block.start - reach[0], 0)))
        part = camera.step(light, block).words[:, first:stop]
        words[block.start // WORD :][: len(part)] = part
    keep_sums()  # a worker is killed when its bands are done
    return words


class Strip:
    """Rows of the light of a scene.

    The scene is asked cycle by cycle and each of its planes is cut at once, so that no more than a
    few whole planes are in memory: those that the scene and the lens keep.

    Args:
        source: the scene.
        relay: its light to that on the pixels; it may need whole planes.
        rows: first row, and the one after the last.
        reach: cycles before and after a block whose light the block needs as well.
    """

    def __init__(
        self, source: Source, relay: Callable[[Light], Light], rows: tuple[int, int],
        reach: tuple[int, int],
    ) -> None:  # fmt: skip
        self._source, self._relay = source, relay
        self._rows, self._reach = rows, reach
        self._cycle = 0
        self._last: Piece | None = None
        self._cuts: list[tuple[Plane, Plane]] = []
        self._pieces: list[Piece] = []

    def _cut(self, plane: Plane) -> Plane:
        for drawn, cut in self._cuts:
            if drawn is plane:
                return cut
        cut = np.ascontiguousarray(plane[self._rows[0] : self._rows[1]])
        self._cuts = [*self._cuts[-1:], (plane, cut)]
        return cut

    def _piece(self, piece: Piece) -> Piece:
        low, high = self._rows
        box = piece.changed
        if box is not None:
            top, bottom = (min(max(row - low, 0), high - low) for row in box[:2])
            box = (top, bottom, *box[2:]) if top < bottom else (0, 0, 0, 0)
        return Piece(piece.start, piece.stop, self._cut(piece.first), self._cut(piece.last), box)

    def step(self, block: Block, start_ps: int) -> Light:
        """Light of a block and of the cycles around it.

        Args:
            block: the block; blocks follow each other.
            start_ps: instant from which on light is needed, ps.
        """
        while self._cycle < block.stop + self._reach[1]:
            light = self._relay(self._source.step(None, Block(self._cycle, 1)))
            for piece in light.pieces:
                if self._last is None or piece.start >= self._last.stop:
                    self._pieces.append(self._piece(piece))
                    self._last = piece
            self._cycle += 1
        self._pieces = [piece for piece in self._pieces if piece.stop > start_ps]
        return Light(tuple(self._pieces))
