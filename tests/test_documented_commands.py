"""Every command that README and docs name runs, smaller where it is long, or says why it cannot.

A command is a line of a code block that begins with a program's name. It runs as it is written, in
a folder with the files that it names, with these changes: the scenarios of `SIZES` are made small,
a port of a board is one of a simulated board, and `CHANGES` has what a single command needs. A new
command needs no entry unless it is long.
"""

from __future__ import annotations

import os
import re
import shlex
import shutil
import subprocess
import sys
import textwrap
from collections.abc import Iterator
from contextlib import ExitStack
from functools import partial
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

import av
import cv2
import numpy as np
import pytest
import zarr
from typer.main import get_command

import scenarios.studies.bench.display as loop
from cosim import Clock, Viform
from cosim.files import write_stream
from rtl_model.geometry import Geometry
from rtl_model.virtual.ethernet import EthernetBoard
from scenarios.assemble.schema.loading import load
from scenarios.cli.app import app
from scenarios.cli.entry import _main
from scenarios.cli.study.bench import STUDIES
from scenarios.studies.bench.sensor import PARTS
from tests.recorded.cases import LINK
from tests.scenarios.studies.bench.small import SMALL_BENCH, make_bench_small

DURATION = loop.DURATION
"""Duration of a timed run of `bench loop`, before a test makes it small."""
ROOT = Path(__file__).resolve().parent.parent
DOCUMENTS = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
PROGRAMS = "viform|make|mkdir|python|sudo|pip-compile|cp|mkfifo|ssh|camera-program"
COMMAND = re.compile(rf" {{4,}}((?:\./)?(?:{PROGRAMS})(?: .*)?)$")


class Command(NamedTuple):
    """A command of a document. text: without `./` and the comment, blanks made single."""

    document: str
    line: int
    text: str


class Change(NamedTuple):
    """How a command is run.

    more: words that are added at its end. swaps: texts and what replaces them. sized: words in the
    place of those of `SIZES`. first: commands that make what it needs. cannot: why it does not run.
    serves: it runs until it is ended, after the commands that follow. code: its exit code. quick:
    it takes less than a second, and runs in the ordinary suite.
    """

    more: str = ""
    swaps: tuple[tuple[str, str], ...] = ()
    sized: str | None = None
    first: tuple[str, ...] = ()
    cannot: str = ""
    serves: bool = False
    code: int = 0
    quick: bool = False


def commands(document: Path) -> list[Command]:
    """The commands of a document's code blocks, lines that go on joined."""
    found, lines = [], iter(enumerate(document.read_text(encoding="utf-8").split("\n"), 1))
    for number, line in lines:
        whole = line
        while whole.endswith("\\"):
            whole = whole[:-1].rstrip() + " " + next(lines)[1].strip()
        if (match := COMMAND.match(whole)) is not None:
            text = re.sub(r"\s+#\s.*", "", match[1]).removeprefix("./")
            found.append(Command(document.name, number, re.sub(r" {2,}", " ", text.strip())))
    return found


def _path(document: str) -> str:
    return document if document == "README.md" else f"docs/{document}"


ALL = [command for document in DOCUMENTS for command in commands(document)]


def examples(document: Path) -> list[str]:
    """The examples in Python of a document: fenced blocks, and blocks that begin with an import."""
    text = document.read_text(encoding="utf-8")
    fenced = re.findall(r"```python\n(.*?)```", text, re.S)
    indented = re.findall(r"^(    (?:import|from) .*\n(?:(?:    .*)?\n)*)", text, re.M)
    return [textwrap.dedent(block) for block in (*fenced, *indented)]


def _sets(*assignments: str) -> str:
    return " ".join(f"--set {shlex.quote(each)}" for each in assignments)


TINY = _sets("sensor.width=64", "sensor.height=48", "duration=3 ms")
PANEL = _sets("display.beside=[]", "display.projector=none", "display.renderer=numpy")
GLASS = f"{TINY} {PANEL}"
CARRIED = _sets(
    "sensor.width=32", "sensor.height=24", "duration=8 ms", "image.at=[160]",
    "link.panel.width=192", "link.panel.height=192", "link.sensor.chip=spikeone",
    "code.cycles=64", "code.tile=8",
)  # fmt: skip
STREAM_LINK = _sets(
    "link.panel.width=192", "link.panel.height=192", "link.sensor.chip=spikeone",
    "link.sensor.threshold=1000 e", "code.cycles=64", "code.tile=8",
)  # fmt: skip
UDP_BOARD = Geometry(
    rows=4, columns=40, lanes=32, clock_hz=460_800, capture_words=2048, sink_words=64
)
EVENTS = _sets("sensor.asynchronous.width=32", "sensor.asynchronous.height=24")
BOARD = _sets("board.level=model", "board.rows=4", "board.columns=40", "board.frames=12")
SIZES = {
    "film": TINY, "star": TINY, "objects": TINY, "glass": GLASS,
    "wave": _sets("sensor.width=64", "sensor.height=48", "duration=4 ms", "image.at=[40]"),
    "step": f"{TINY} {_sets('scene.at=1 ms')}",
    "light-link": " ".join(shlex.quote(word) for word in LINK),
    "glass-over-light": f"{CARRIED} {PANEL}",
    "playback": f"{PANEL} {_sets('duration=3 ms')}",
    "sun-and-stars": _sets("sensor.asynchronous.width=96", "sensor.asynchronous.height=96"),
    "adaptive-exposure": _sets("duration=60 ms"),
    "ebaps-night": _sets("duration=200 ms", "imager.rows=64", "imager.columns=80"),
    "emccd-window": _sets("duration=120 ms"),
    "bring-up": BOARD,
}  # fmt: skip
"""What makes each scenario small."""
QUICK = Change(quick=True)
INSTALLS = Change(cannot="it installs system packages")
INDEX = Change(cannot="it asks a package index, and writes the lists of the project")
BUILDS = Change("-n")
"""A build for an FPGA: `make` says what it would do, without the programs of the FPGA's maker."""
CHANGES: dict[str, Change] = {
    # images
    "viform image runs/film-1 --at 1280 --method tfp --window 41 --scale 0.6 --out a.png": QUICK,
    "viform image recording.dat --at 150 --method tfi --scale 0.6 --out b.png": QUICK,
    # boards
    "viform board bringup --port virtual --level pins --fault baud=6": Change(code=1),
    "viform board virtual --udp 127.0.0.1": Change(
        "--level model --rows 4 --columns 40", swaps=(("127.0.0.1", "127.0.0.1:0"),), serves=True
    ),
    "viform board regs --list": QUICK,
    "viform board regs --port /dev/ttyUSB1 --csr csr.csv": Change(
        cannot="it needs a LiteX design on a board; tests/rtl_model/litex has a simulated one"
    ),
    "viform board compare --lockstep --pixels 1e7 --trace difference.fst": Change("--pixels 1e4"),
    "viform board stream array --depth 64": Change("--rows 8 --columns 64 --clocks 5000"),
    "viform board stream array --rows 64 --columns 64 --depth 256": Change("--clocks 5000"),
    "viform board links": QUICK,
    "viform board replay line.jsonl": Change(
        first=("viform board bringup --port virtual --level model --log line.jsonl",)
    ),
    "viform board virtual --imager emccd --link /tmp/emccd": Change(serves=True),
    "viform board gateware --list": QUICK,
    "viform board gateware ulx3s-25f --out spikes": QUICK,
    "viform board gateware ulx3s-25f --ethernet rmii --ip 192.168.1.50 --out spikes": Change(
        swaps=(("--out spikes", "--out spikes-ethernet"),)
    ),
    "make -C spikes": BUILDS, "make -C spikes program": BUILDS,
    # codes and recordings
    "viform link receive recording.zarr --out got": Change(
        swaps=(("recording.zarr", "runs/light-link-1/stream.zarr"),)
    ),
    "viform run playback --set sensor.source=pipe:planes --set sensor.width=1000 "
    "--set sensor.height=1000": Change(_sets("sensor.width=64", "sensor.height=48")),
    "camera-program | viform run playback --set sensor.source=pipe:- --set link.distance='2 m' "
    "--set duration='1 s'": Change(_sets("sensor.width=64", "sensor.height=48")),
    "ssh camera-host camera-program | viform run playback --set sensor.source=pipe:- "
    "--set sensor.clock='20 kHz'": Change(_sets("sensor.width=64", "sensor.height=48")),
    "viform convert RUN film/film.dat --config": Change(swaps=(("RUN", "runs/film-1"),)),
    "viform convert runs/film-1 a.fsc": QUICK,
    "viform convert a.fsc a.dat": QUICK,
    "viform convert runs/film-1 a.vfl": QUICK,
    "viform convert a.vfl a.dat": QUICK,
    "viform view runs/film-1": Change(serves=True),
    "viform view recording.dat --size 400x250": Change(serves=True),
    "python -m scenarios.studies.codes.ladder STREAM": Change(
        swaps=(("STREAM", "runs/film-1"),)
    ),
    "viform run light-link --set link.file=photo.jpg --set link.distance='4 m'": Change(
        _sets("link.modem.cell=4")  # the small panel's image has half a camera pixel to a cell of 2
    ),
    "viform run film --set scene.kind=KIND --set sensor.chip=spikeone --set 'duration=32 ms' "
    "--set 'image.at=[320, 640, 960]' --out runs/KIND && viform compare-methods runs/KIND": Change(
        sized=_sets("sensor.width=64", "sensor.height=48")
    ),
    # studies
    "viform compare star": Change(_sets("duration=20 ms")),
    "viform compare-tracking": Change("--trials 1 --speeds 3"),
    "viform compare-tracking --speeds 1,10,100 --frame-rates 120,5000 --white 0.1 --trials 20 "
    "--figure tracking.png": Change("--trials 1 --speeds 10"),
    "viform paper": Change("003"),
    "viform paper --json": Change("003"),
    "viform stability": Change("1"),
    "viform stability --json": Change("1"),
    "viform link ber --out ber": Change("--points 2 --no-detectors"),
    "viform link ber --no-detectors": Change("--points 2"),
    "viform link capacity": Change("--symbols 200"),
    "viform link capacity --out cap": Change("--symbols 200 --points 2"),
    "viform dataset objects --out set --camera spikeone --camera worn.toml --samples 8 "
    "--vary scene.illuminance='400 lux:2000 lux:log' --vary scene.speed=2:20 "
    "--vary sensor.pattern.device_seed=0:99:int": Change(f"--samples 2 {_sets('duration=3 ms')}"),
    "viform dataset clips/ --out films --set duration='20 ms' "
    "--vary sensor.lens.white_rate=0.2:0.8": Change(f"--samples 2 {TINY}"),
    "viform sweep film --vary sensor.threshold='500 e:4000 e:8log' "
    "--vary scene.illuminance='400 lux,800 lux'": Change(swaps=((":8log", ":2log"),)),
    "viform sweep light-link --vary link.distance='1 m:10 m' "
    "--vary link.air.ambient='10 lux:10000 lux:log' --samples 40": Change("--samples 2"),
    "viform run film --workers 4": Change("--workers 2"),
    "viform run film --set sensor.width=8000 --set sensor.height=8000 "
    "--scheduler tcp://host:8786": Change(cannot="it needs a Dask scheduler of other machines"),
    # scenarios whose keys exclude those of SIZES
    "viform run glass --set sensor.pixel=asynchronous": Change(sized=EVENTS),
    "viform run step --set sensor.pixel=asynchronous --set link.distance='2 m'": Change(
        sized=EVENTS
    ),
    # the set-up
    "sudo apt-get install -y python3 python3-venv": INSTALLS,
    "pip-compile $flags --extra build --extra dev -o requirements-dev.lock pyproject.toml": INDEX,
    "cp requirements-dev.lock requirements.lock": INDEX,
    "pip-compile $flags --extra build -o requirements.lock pyproject.toml": INDEX,
}  # fmt: skip
"""By command, without `./` and the comment."""
EVERYWHERE = (
    ("serial:/dev/ttyUSB0,3000000", "serial:virtual"), ("/dev/ttyUSB0", "virtual"),
    ("scene.kind=KIND", "scene.kind=star"), ("KIND", "star"), ("/tmp/emccd", "emccd"),
)  # fmt: skip
"""Replaced in every command: ports of boards, and names that stand for any."""


def test_every_entry_is_of_a_command_that_a_document_names() -> None:
    assert len(ALL) >= 147
    assert set(CHANGES) - {command.text for command in ALL} == set()


def _read(command: Any, words: list[str]) -> None:
    """Reads the words of a command as the command line would, without running it. A scenario that
    needs no file of another command is read too, and `bench` assembles what it would run."""
    path = []
    while (group := getattr(command, "commands", None)) is not None:
        path.append(words[0])
        command, words = group[words[0]], words[1:]
    given = command.make_context(" ".join(path), [*words]).params
    if path[0] in ("run", "plan", "accuracy") and ".toml" not in " ".join(words):
        load(given["scenario"] or "glass", given["assignments"] or [])
    if path[0] == "bench":
        assert given["part"] in (None, *PARTS, *STUDIES), given["part"]
        if given["part"] in (None, "loop"):
            for scenario, *sets in loop.LOOPS.values():
                for duration in (loop.WARM, loop.DURATION):
                    loop.loop_machine(scenario, None, sets, duration).close()


def test_every_command_is_one_that_the_command_line_reads(monkeypatch: pytest.MonkeyPatch) -> None:
    make_bench_small(monkeypatch, "loop")
    monkeypatch.setattr(loop, "DURATION", DURATION)
    wrong, line = [], get_command(app)
    for command in {command.text: command for command in ALL}.values():
        for part in _parts(command.text):
            if part.partition(" ")[0] == "viform":
                try:
                    _read(line, shlex.split(part.replace("KIND", "star"))[1:])
                except Exception as exc:
                    wrong.append(f"{command.document}:{command.line}: {part}: {exc}")
    assert wrong == []


def _parts(text: str) -> list[str]:
    """The commands of a line of a shell, and the signs between them."""
    return re.split(r"( \| | && )", text)


def _small(text: str, change: Change) -> str:
    """The command with what makes it small."""
    words = shlex.split(text)
    if words[0] != "viform":
        return text
    named = [word for word in words[2:3] if not word.startswith("-")]
    scenario = named[0] if named else "glass"
    if words[1] in ("run", "plan", "accuracy", "sweep") and scenario in SIZES:
        sized = SIZES[scenario] if change.sized is None else change.sized
        if re.search(r"sensor\.source=(serial|udp):", text):  # a board has a size of its own
            sized = re.sub(r"--set sensor\.(width|height)=\d+", "", sized)
        text = f"{text} {sized}"
    if words[1] == "run" and "link.distance" in text and scenario != "light-link":
        text += f" {STREAM_LINK}"
    if words[1] == "board" and "--port virtual" in text and "--level" not in text:
        text += " --level model" if words[2] not in ("identify", "regs") else ""
    return text


def _write_clip(path: Path, frames: np.ndarray) -> None:
    path.parent.mkdir(exist_ok=True)
    with av.open(str(path), "w") as container:
        stream = container.add_stream("mpeg4", rate=25)
        stream.height, stream.width, stream.pix_fmt = *frames.shape[1:3], "yuv420p"
        for pixels in frames:
            container.mux(stream.encode(av.VideoFrame.from_ndarray(pixels, format="rgb24")))
        container.mux(stream.encode(None))


def _block(document: str, first: str) -> str:
    """The indented or fenced block of a document that begins with a line."""
    text = (ROOT / "docs" / document).read_text(encoding="utf-8")
    found = re.search(rf"^( *){re.escape(first)}\n((?:\1(?!```).+\n)+)", text, re.M)
    assert found is not None, (document, first)
    return textwrap.dedent(found[0])


PROGRAMS_OF_OTHERS = {
    # Without --out it writes 120 planes of 64 x 48 pixels to standard output.
    "camera-program": 'exec > "${2:-/dev/stdout}"\nhead -c 46080 /dev/urandom',
    "ssh": 'shift\nexec "$@"',
}
"""Programs that the documents name as those of a user, as lines of a shell."""


class Place:
    """A folder with the files that documents name, in which the commands of one document run."""

    def __init__(self, folder: Path, film: Path | None) -> None:
        """film: the run that documents call `runs/film-1`; None for its stream alone, random."""
        self.folder, self.running, self._udp = folder, ExitStack(), ""
        (folder / "runs").mkdir(parents=True)
        random = np.random.default_rng(2)
        if film is None:
            words = random.integers(0, 2**32, (2, 80, 48, 64), dtype=np.uint32)
            stream = Viform(words[0] & words[1], 2560, Clock(40_000), 0)  # a quarter fires
            (folder / "runs/film-1").mkdir()
            write_stream(stream, folder / "runs/film-1/stream.zarr")
        else:
            shutil.copytree(film, folder / "runs/film-1")
        frames = np.random.default_rng(1).integers(0, 256, (20, 48, 64, 3), dtype=np.uint8)
        for name in ("clip.mp4", "bikes.mp4", "clips/one.mp4"):
            _write_clip(folder / name, frames)
        (folder / "frames").mkdir()
        for n, frame in enumerate(frames):
            cv2.imwrite(str(folder / f"frames/{n:03}.png"), frame)
        cv2.imwrite(str(folder / "photo.jpg"), frames[0])
        cv2.imwrite(str(folder / "truth.png"), np.full((250, 400), 128, np.uint8))
        words = random.integers(0, 2**32, (2, 10, 250, 400), dtype=np.uint32)
        stream = Viform(words[0] & words[1], 320, Clock(40_000), 0)
        for name in ("recording.dat", "camera.dat", "reds_200_part1.dat", "recording.npz"):
            write_stream(stream, folder / name)
        (folder / "budget.toml").write_text('sensors = ["dalsa"]\npower = "2 W"\n')
        (folder / "worn.toml").write_text(_block("dataset.md", "[sensor]"))
        (folder / "still.toml").write_text(
            _block("calibration.md", 'title = "A camera under still light"')
        )
        (folder / "programs").mkdir()
        for name, lines in PROGRAMS_OF_OTHERS.items():
            (folder / "programs" / name).write_text(f"#!/bin/sh\n{lines}\n")
            (folder / "programs" / name).chmod(0o755)
        path = folder / "programs", Path(sys.executable).parent, os.environ["PATH"]
        shown = "DISPLAY", "WAYLAND_DISPLAY", "BROWSER"
        self.environment = {k: v for k, v in os.environ.items() if k not in shown}
        self.environment |= {"PATH": os.pathsep.join(map(str, path)), "PYTHONPATH": str(ROOT)}

    def run(self, command: Command) -> str:
        """Runs a command; returns what is wrong with it, empty if nothing."""
        change = CHANGES.get(command.text, Change())
        if change.cannot:
            return ""
        for first in change.first:
            assert _main(shlex.split(first)[1:]) == 0, first
        text = self._changed(command.text, change)
        if change.serves:
            wrong = self._serve(text)
        elif re.search("[|&]", text) or not text.startswith("viform "):
            said = self.folder / "said"  # a pipe would wait for programs in the background
            with said.open("w") as sink:
                code = subprocess.run(
                    ["bash", "-c", text], cwd=self.folder, env=self.environment, timeout=600,
                    stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=sink,
                ).returncode  # fmt: skip
            wrong = "" if code == change.code else f"exit code {code}: {said.read_text()}"
        else:
            code = _main(shlex.split(text)[1:])
            wrong = "" if code == change.code else f"exit code {code}"
        return wrong and f"{command.document}:{command.line}: {text}: {wrong}"

    def _changed(self, text: str, change: Change) -> str:
        for old, new in (*change.swaps, *EVERYWHERE):
            text = text.replace(old, new)
        text = re.sub(r"udp:(192\.168\.1\.50|127\.0\.0\.1)\b", lambda _: self._board(), text)
        small = "".join(_small(part, change) for part in _parts(text))
        small = small.replace("python ", f"{shlex.quote(sys.executable)} ")
        return f"{small} {change.more}".strip()

    def _board(self) -> str:
        """The address of a simulated board over UDP."""
        if not self._udp:
            board = EthernetBoard("udp:127.0.0.1:0", UDP_BOARD, level="model")
            self._udp = self.running.enter_context(board).port
        return self._udp

    def _serve(self, text: str) -> str:
        """Starts a command that runs until it is ended, and waits for what it says first."""
        process = subprocess.Popen(
            shlex.split(text), cwd=self.folder, env=self.environment, stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT, text=True,
        )  # fmt: skip

        def end() -> None:
            alive = process.poll() is None
            process.terminate()
            rest = process.communicate()[0]
            assert alive, f"{text} ended by itself: {rest}"

        self.running.callback(end)
        assert process.stdout is not None
        said = process.stdout.readline()
        refused = re.match(r"viform: .+ must be .+, not ", said)
        return "" if process.poll() is None and said and not refused else f"ended: {said}"


@pytest.fixture(scope="session")
def film(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of 2560 cycles, small."""
    folder = tmp_path_factory.mktemp("documented") / "film-1"
    sets = ("sensor.width=64", "sensor.height=48")
    words = [word for each in sets for word in ("--set", each)]
    assert _main(["run", "film", *words, "--out", str(folder)]) == 0
    return folder


@pytest.fixture
def place(
    request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Place]:
    slow = request.node.get_closest_marker("slow") is not None
    made = Place(tmp_path / "place", request.getfixturevalue("film") if slow else None)
    monkeypatch.chdir(made.folder)
    with made.running:
        yield made


GIVEN = {
    "README.md": "frames = __import__('numpy').zeros((160, 48, 64), 'uint8') + 128",
    "adaptive-exposure.md": "lux = __import__('numpy').full((256, 256), 1e-3)",
    "emccd.md": "import numpy as np\nfrom pathlib import Path\n"
    "from imagers.common.scenery import Still\n"
    "scene, until = Still(np.full((528, 536), 1e-3)), 4 * 10**10",
}
"""What the examples of a document take as given."""
TESTED = {"python.md", "dataset.md"}
"""Documents whose examples run in the ordinary suite."""


def _open_zarr(path: str, consolidated: bool) -> dict[str, Any]:
    """In the place of `xarray`, which the suite does without: arrays that select by a label."""
    assert not consolidated
    arrays: dict[str, Any] = dict(zarr.open_group(path, mode="r").arrays())

    def select(array: Any, labels: dict[str, float]) -> Any:
        at = [
            int(np.flatnonzero(arrays[name][:] == labels[name])[0])
            if name in labels
            else slice(None)
            for name in array.metadata.dimension_names
        ]
        return array[tuple(at)]

    return {name: SimpleNamespace(sel=partial(select, array)) for name, array in arrays.items()}


def _run(place: Place, chosen: list[Command]) -> None:
    wrong = [said for command in chosen if (said := place.run(command))]
    assert wrong == [], "\n".join(wrong)


def test_quick_commands_run(place: Place) -> None:
    found = {command.text: command for command in ALL}
    _run(place, [found[text] for text, change in CHANGES.items() if change.quick])


@pytest.mark.slow
@pytest.mark.parametrize("document", sorted({command.document for command in ALL}))
def test_commands_of_a_document_run(
    document: str, place: Place, monkeypatch: pytest.MonkeyPatch
) -> None:
    make_bench_small(monkeypatch, *SMALL_BENCH)
    _run(place, [command for command in ALL if command.document == document])
    monkeypatch.setitem(sys.modules, "xarray", SimpleNamespace(open_zarr=_open_zarr))
    names: dict[str, Any] = {}
    if document not in TESTED:
        for example in (GIVEN.get(document, ""), *examples(ROOT / _path(document))):
            exec(compile(example, document, "exec"), names)
