"""How fast `viform view` answers: the first picture, steps of a user who scrolls, peak memory.

The stream has 1000 x 1000 pixels and 20 000 cycles, and is drawn once, not timed. The command runs
in a process of its own and is asked over its socket, as by a browser, which draws in some further
milliseconds. Steps of a picture whose chunks are decoded (`step`), into a chunk that is not
(`chunk`) and far away (`jump`) are the median of several, for TFP and for TFI; start and first
picture are single.
"""

from __future__ import annotations

import http.client
import json
import os
import statistics
import subprocess
import tempfile
import time
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Final
from urllib.parse import parse_qs, urlsplit

import numpy as np

from cosim.clock import Clock
from cosim.compute.forks import python_child
from cosim.compute.opencl import Device
from cosim.files.recorder import Recorder
from cosim.run.folder import check_room
from cosim.run.timing import BRIGHT, DARK, REAL_TIME, TimingRow
from cosim.spikes.viform import Viform, Words
from cosim.stage import Block

SHAPE: Final = (1000, 1000)
CYCLES: Final = 20_000
_BLOCK: Final = 64
"""Cycles of a block, which is a chunk of the store."""
_DRAWN: Final = 8
"""Blocks that are drawn; the stream repeats them."""
_WINDOW: Final = 41
_STEPS: Final = 15
_FAR: Final = 37
"""Blocks between two jumps."""
_PAUSE_S: Final = 0.1
"""Pause between two steps of a user who scrolls, s: ten pictures a second."""


def _block(random: np.random.Generator, shape: tuple[int, int]) -> Words:
    """Spikes of 64 cycles, (2, H, W): each at random, at a rate that grows from the left edge, of
    `DARK`, to the right one, of `BRIGHT`, in steps of 1/256."""
    rates = np.rint(np.linspace(DARK, BRIGHT, shape[1]) * 256).astype(np.uint8)
    words = np.zeros((2, *shape), np.uint32)
    for cycle in range(_BLOCK):
        drawn = np.frombuffer(random.bytes(shape[0] * shape[1]), np.uint8).reshape(shape)
        words[cycle // 32] |= (drawn < rates).astype(np.uint32) << np.uint32(cycle % 32)
    return words


def write_stream(path: Path, shape: tuple[int, int] = SHAPE, cycles: int = CYCLES) -> None:
    """Writes the stream of the benchmark. cycles: whole blocks or not."""
    random, clock = np.random.default_rng(1), Clock(round(REAL_TIME))
    blocks = [_block(random, shape) for _ in range(min(_DRAWN, -(-cycles // _BLOCK)))]
    recorder = Recorder(path, shape, cycles, clock)
    for n, start in enumerate(range(0, cycles, _BLOCK)):
        block = Block(start, min(_BLOCK, cycles - start))
        words = blocks[n % len(blocks)]
        if block.cycles < _BLOCK:
            words = words[: -(-block.cycles // 32)]
            words = words & np.uint32((1 << (block.cycles % 32 or 32)) - 1)
        recorder.step(Viform(words, block.cycles, clock, start), block)


class _Viewer:
    """`viform view` in a process of its own, and a connection to it."""

    def __init__(self, process: subprocess.Popen[str], stream: Path) -> None:
        assert process.stdout is not None
        self.process = process
        said = process.stdout.readline()
        while said and not said.rstrip().endswith("}"):
            said += process.stdout.readline()
        parts = urlsplit(json.loads(said)["address"])
        self._token = parse_qs(parts.query)["token"][0]
        self._line = http.client.HTTPConnection(parts.hostname or "", parts.port, timeout=600)

    def close(self) -> None:
        self._line.close()

    def ask(self, what: str, **values: object) -> tuple[float, bytes]:
        """Seconds until the answer has arrived, and the answer."""
        query = "&".join([f"token={self._token}", *(f"{k}={v}" for k, v in values.items())])
        begin = time.perf_counter()
        self._line.request("GET", f"/{what}?{query}")
        answer = self._line.getresponse()
        content = answer.read()
        spent = time.perf_counter() - begin
        if answer.status != 200:
            raise RuntimeError(f"viform view answers {answer.status}: {content.decode()}")
        return spent, content

    def picture(self, at: int, method: str = "tfp") -> float:
        """Seconds until a picture has arrived."""
        return self.ask("rates", at=at, method=method, window=_WINDOW)[0]

    def peak(self) -> float:
        """Bytes that the process has held at most (proc(5), VmHWM)."""
        status = Path(f"/proc/{self.process.pid}/status").read_text(encoding="utf-8")
        line = next(line for line in status.splitlines() if line.startswith("VmHWM"))
        return 1024 * float(line.split()[1])


@contextmanager
def _viewing(stream: Path) -> Iterator[_Viewer]:
    code = "from scenarios.cli.entry import main; main()"
    process = subprocess.Popen(
        python_child(code, "view", str(stream), "--json"),
        stdout=subprocess.PIPE, encoding="utf-8", errors="replace", env=_without_browser(),
    )  # fmt: skip
    try:
        viewer = _Viewer(process, stream)
        with closing(viewer):
            yield viewer
    finally:
        process.kill()  # it holds nothing, and would say that it ended
        process.communicate()


def _without_browser() -> dict[str, str]:
    hidden = ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER")
    return {name: value for name, value in os.environ.items() if name not in hidden}


def _measure(stream: Path, cycles: int) -> dict[str, float]:
    """Seconds and bytes by the name of a row."""
    found = {}
    begin = time.perf_counter()
    with _viewing(stream) as viewer:
        found["start"] = time.perf_counter() - begin
        begin = time.perf_counter()
        while b"data-kind='stream'" not in viewer.ask("")[1]:
            time.sleep(0.02)
        at = cycles // 2 // _BLOCK * _BLOCK + _BLOCK // 2
        viewer.picture(at)
        found["first-picture"] = time.perf_counter() - begin

        def steps(method: str, by: int) -> float:
            times = []
            for n in range(1, _STEPS + 1):
                time.sleep(_PAUSE_S)
                times.append(viewer.picture(at + n * by, method))
            return statistics.median(times)

        far = [(at + n * _FAR * _BLOCK) % (cycles // _BLOCK * _BLOCK) for n in range(1, _STEPS + 1)]
        for method, back in (("tfp", 1), ("tfi", -1)):
            viewer.picture(at, method)
            found[f"step-{method}"] = steps(method, 0)
            found[f"chunk-{method}"] = steps(method, back * _BLOCK)
            found[f"jump-{method}"] = statistics.median(viewer.picture(c, method) for c in far)
        found["memory"] = viewer.peak()
    return found


def view_rows(device: Device | None, ceiling: float | None) -> list[TimingRow]:
    """Rows of the times, s, and of the peak memory, B. The device and its ceiling are not used.
    Raises InputError if there is no room for the stream."""
    with tempfile.TemporaryDirectory() as folder:
        check_room(Path(folder), SHAPE[0] * SHAPE[1] * CYCLES)
        stream = Path(folder) / "stream.zarr"
        write_stream(stream)
        measured = _measure(stream, CYCLES)
    return [
        TimingRow(
            f"view.{name}", "numba", value, "B" if name == "memory" else "s", None, None, None
        )
        for name, value in measured.items()
    ]
