"""Runs random scenarios in a process that is kept, and says what is wrong with them.

`python -m tests.fuzz.judging N ...` runs the scenarios of these numbers in this process.
"""

from __future__ import annotations

import contextlib
import faulthandler
import io
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import traceback
import warnings
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any, Final
from unittest import mock

import numpy as np
import psutil
import tomli_w
import typer.main

from display.probes import metrics
from tests.fuzz.scenarios import Data, Drawn, draw

LONGEST: Final = 300
"""Characters of a refusal."""
CORRECTIONS: Final = 20
"""Corrections of a scenario that are applied, one after another."""
FLOOR_S: Final = 8.0
"""Processor time of imports, compilation and report, which a forecast does not have."""
PLANNED: Final = 5
"""One scenario of so many is planned as well."""
TIMES: Final = 10
"""Times the forecast that a run may take."""
ENDLESS: Final = -2
"""Code of a scenario that has not ended."""
IDLE_S: Final = 60.0
"""Time with next to no processor time after which a process hangs."""
KEPT: Final = 100
"""Scenarios after which a process is replaced, for its memory."""
_FIELDS: Final = (
    "scenario", "outcome", "seed", "version", "device", "renderer", "simulated_s", "run_time_s",
    "error", "plan", "metrics", "latency", "throughput", "files",
)  # fmt: skip
_REFUSAL: Final = re.compile(
    r"viform: (?P<what>.+?) must be (?P<must>.+?), not (?P<actual>.+); (?P<remedy>[^;]+)\n"
)
_SET: Final = re.compile(
    r"(?:--set|set|write|take)\s+([a-z_0-9]+(?:\.[a-z_0-9]+)+)=('[^']*'|[^\s,;)]+)"
)

_AMOUNT: Final = (
    r"(-?[\d.]+(?:e[-+]?\d+)?(?: "
    r"(?:[GMkmunpfµ]?(?:s|Hz|m|V)|bit/s|e/s|e|lux|Pa|px/s|cd/m²)(?![\w/]))?)"
)
_BOUND: Final = re.compile(rf"at (?:least|most)(?: [^,\d]*,)? {_AMOUNT}")
_RANGE: Final = re.compile(rf"\d(?: \S+)? to {_AMOUNT}")


@dataclass
class Case:
    """What became of a scenario.

    Attributes:
        number: Number of the scenario.
        code: exit code of the last command.
        seconds: processor time of all its commands.
        said: refusals, in order.
        wrong: what is wrong, in a line each.
        unproposed: refusals from which no correction was read.
    """

    number: int
    code: int = -1
    seconds: float = 0.0
    said: list[str] = field(default_factory=list)
    wrong: list[str] = field(default_factory=list)
    unproposed: list[str] = field(default_factory=list)


def make_ready(folder: Path) -> None:
    """Writes the files that scenarios name, and does once what a command does each time."""
    import cv2

    from cosim import Clock, Viform
    from cosim.files import write_stream

    rng = np.random.default_rng(1)
    cv2.imwrite(str(folder / "picture.png"), rng.integers(0, 256, (24, 32, 3), dtype=np.uint8))
    np.save(folder / "frames.npy", rng.integers(0, 256, (6, 16, 24), dtype=np.uint8))
    planes = rng.random((100, 12, 16)) < 0.3
    write_stream(Viform.from_planes(planes, Clock(40_000)), folder / "recording.npz")
    for name in ("recording.dat", "recording.events.npz"):
        extra = ["--config"] if name.endswith(".dat") else []
        command("convert", str(folder / "recording.npz"), str(folder / name), *extra)
    typer.main.get_command = cache(typer.main.get_command)
    (folder / "sent.txt").write_text("a message " * 9)


@contextlib.contextmanager
def _caught() -> Iterator[dict[str, str]]:
    """Catches what is written to standard output and standard error, by libraries too."""
    said: dict[str, str] = {}
    kept = {number: os.dup(number) for number in (1, 2)}
    files = {number: tempfile.TemporaryFile() for number in (1, 2)}  # noqa: SIM115
    streams = sys.stdout, sys.stderr
    try:
        for number, file in files.items():
            os.dup2(file.fileno(), number)
        sys.stdout, sys.stderr = (
            io.TextIOWrapper(io.FileIO(number, "w", closefd=False), "utf-8", write_through=True)
            for number in (1, 2)
        )
        yield said
    finally:
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
        sys.stdout, sys.stderr = streams
        for number, name in ((1, "out"), (2, "err")):
            os.dup2(kept[number], number)
            os.close(kept[number])
            files[number].seek(0)
            said[name] = files[number].read().decode("utf-8", "replace")
            files[number].close()


def command(*arguments: str) -> tuple[int, str, str, str]:
    """Runs a command in this process: exit code, standard output and error, and what has escaped
    it."""
    from scenarios.cli.entry import _main, _of_the_machine

    code, escaped = -1, ""
    with _caught() as said, warnings.catch_warnings():
        warnings.simplefilter("default")
        warnings.simplefilter("ignore", DeprecationWarning)
        try:
            code = _main(list(arguments))
        except Exception as exc:
            line = _of_the_machine(exc)
            if line is None:
                escaped = traceback.format_exc()
            else:
                print(f"viform: {line}", file=sys.stderr)
                code = 2
    return code, said["out"], said["err"], escaped


def run_case(number: int, folder: Path) -> Case:
    """Runs a scenario; one that is refused again and again with its own corrections."""
    case, drawn = Case(number), draw(number)
    before, began = None, time.process_time()
    met: set[tuple[str, str]] = set()
    if number % PLANNED == 0:
        forecast(number, folder, case)
    for attempt in range(CORRECTIONS + 1):
        with _few_probes(number):
            refusal = _run(drawn, folder, case)
        if refusal is None or case.wrong:
            break
        line = refusal.group().strip()
        key = refusal["what"], refusal["must"]
        # Of two keys that exclude each other, one can be left out, as both refusals say.
        apart = key in met and key != before and "leave it out" in refusal["remedy"]
        if key in met and not (apart and _remove(drawn.data, refusal["what"])):
            case.wrong.append(f"refused again after its correction: {line}")
            break
        case.said.append(line)
        met.add(key)
        before = key
        if attempt < CORRECTIONS and not apart and not _correct(drawn.data, refusal):
            case.unproposed.append(line)
            break
    else:
        case.wrong.append(f"refused {CORRECTIONS + 1} times: {case.said[-1]}")
    case.seconds = time.process_time() - began
    return case


def forecast(number: int, folder: Path, case: Case) -> float:
    """Processor time that `viform plan` predicts, s; 0 where it is none for this kind."""
    drawn, file = draw(number), folder / "case.toml"
    shutil.rmtree(folder / "out", ignore_errors=True)
    file.write_text(tomli_w.dumps(drawn.data), encoding="utf-8")
    code, said, err, escaped = command("plan", str(file), "--json", *drawn.options)
    if escaped:
        case.wrong.append(f"traceback of plan: {escaped}")
    if code == 2:
        _refused(folder / "out", said, err, case)
    if code != 0:
        return 0.0
    try:
        predicted = json.loads(said, parse_constant=_no_constant)["predicted"]
    except ValueError as exc:
        case.wrong.append(f"plan is not one JSON document: {exc}")
        return 0.0
    if "processor_s" in predicted:
        return float(predicted["processor_s"])
    pixels = predicted["sensor_s"] or predicted.get("full_physics_s") or 0.0
    return float(pixels + (predicted.get("scene_s") or 0.0))


def _run(drawn: Drawn, folder: Path, case: Case) -> re.Match[str] | None:
    """Runs a scenario once; its refusal."""
    file, out = folder / "case.toml", folder / "out"
    shutil.rmtree(out, ignore_errors=True)
    file.write_text(tomli_w.dumps(drawn.data), encoding="utf-8")
    code, said, err, escaped = command(
        "run", str(file), "--out", str(out), "--json", *drawn.options
    )
    case.code = code
    foreign = [line for line in err.splitlines() if not line.startswith("viform: ")]
    if escaped:
        case.wrong.append(f"traceback: {escaped}")
    elif foreign:
        case.wrong.append(f"said by a library: {' | '.join(foreign)[:1000]}")
    elif code in (0, 1):
        case.wrong += judge_result(out, said, code)
    elif code != 2:
        case.wrong.append(f"exit {code}: {err[-300:]}")
    else:
        return _refused(out, said, err, case)
    return None


def _refused(out: Path, said: str, err: str, case: Case) -> re.Match[str] | None:
    line = err.splitlines(keepends=True)[-1] if err else ""
    if said:
        case.wrong.append("standard output of a refusal is not empty")
    if (out / "result.json").exists():
        case.wrong.append("a refused run has a result")
    if len(line.rstrip().removeprefix("viform: ")) > LONGEST:
        case.wrong.append(f"refused in {len(line)} characters: {line}")
    refusal = _REFUSAL.fullmatch(line)
    if refusal is None:
        case.wrong.append(f"a refusal of another form: {err[-400:]}")
    return refusal


def _plain(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    assert len({key for key, _ in pairs}) == len(pairs), "a field twice"
    return dict(pairs)


def _no_constant(text: str) -> None:
    raise ValueError(f"{text} is no JSON")


def judge_result(out: Path, said: str, code: int) -> list[str]:
    """What is wrong with the folder and the document of a complete run."""
    try:
        document = json.loads(said, parse_constant=_no_constant, object_pairs_hook=_plain)
    except (ValueError, AssertionError) as exc:
        return [f"standard output is not one JSON document: {exc}"]
    wrong = []
    if (out / "result.json").read_text(encoding="utf-8") != said:
        wrong.append("result.json differs from standard output")
    if tuple(document) != _FIELDS:
        wrong.append(f"fields {tuple(document)}")
    if document["outcome"] not in ("ok", "degraded", "failed"):
        wrong.append(f"outcome {document['outcome']}")
    if (document["outcome"] == "failed") != (code == 1):
        wrong.append(f"outcome {document['outcome']} with exit {code}")
    error, plan = document["error"], document["plan"]
    if not {"value", "kind", "ci", "tolerance"} <= set(error) or set(plan) != {"kept", "left_out"}:
        wrong.append(f"fields of error {sorted(error)} and plan {sorted(plan)}")
    ci = error["ci"]
    if ci is not None and not (len(ci) == 2 and ci[0] <= ci[1]):
        wrong.append(f"ci {ci}")
    for name, metric in document["metrics"].items():
        good = isinstance(metric["value"], int | float | None) and isinstance(metric["unit"], str)
        reason = {"reason"} if metric["value"] is None else set()
        if not {"value", "unit"} <= set(metric) <= {"value", "unit"} | reason or not good:
            wrong.append(f"metric {name}: {metric}")
    for row in document["latency"]:
        times = [row[key] for key in ("min_us", "median_us", "max_us")]
        if times != sorted(times):
            wrong.append(f"latency {row}")
    for row in document["throughput"]:
        if set(row) != {"stage", "value", "unit"}:
            wrong.append(f"throughput {row}")
    if isinstance(document["run_time_s"], float) and not document["run_time_s"] > 0:
        wrong.append(f"run_time_s {document['run_time_s']}")
    wrong += [f"no file {name}" for name in document["files"] if not (out / name).exists()]
    if "report.html" not in document["files"]:
        wrong.append("no report")
    return wrong


def _correct(data: Data, refusal: re.Match[str]) -> bool:
    """Applies what a refusal proposes; False if that is nothing for a program."""
    what, must, remedy = refusal["what"], refusal["must"], refusal["remedy"]
    proposed = _SET.search(remedy)
    if proposed:
        without = re.search(r" without ([^,]+)", remedy)
        if without:
            _remove(data, without[1])
        return _assign(data, proposed[1], proposed[2].strip("'"))
    if re.search(r"\b(leave|take) (it|them) out|remove it", remedy) or must.startswith("absent"):
        return _remove(data, what)
    other = re.fullmatch(r"set (-?[\d.]+\S*)", remedy)
    if other:
        return _assign(data, what, other[1])
    bound = _BOUND.search(must) or _RANGE.search(must)
    if bound:
        return _assign(data, what, bound[1])
    one = re.match(r"one of ([^,]+)", must) or re.search(r"such as '([^']+)'", must)
    return one is not None and _assign(data, what, one[1].strip("'\""))


def _place(data: Data, key: str) -> tuple[Data, str] | None:
    *path, name = key.split(".")
    node = data
    for part in path:
        node = node.setdefault(part, {})
        if not isinstance(node, dict):
            return None
    return node, name


def _assign(data: Data, key: str, text: str) -> bool:
    if not re.fullmatch(r"[a-z_0-9]+(\.[a-z_0-9]+)*", key):
        return False
    found = _place(data, key)
    if found is None:
        return False
    value: Any = json.loads(text) if text.startswith("[") else text
    found[0][found[1]] = value
    return True


def _remove(data: Data, what: str) -> bool:
    keys = re.findall(r"[a-z_]+(?:\.[a-z_0-9]+)*", what)
    places = [found for key in keys if (found := _place(data, key)) and found[1] in found[0]]
    for node, name in places:
        del node[name]
    return bool(places)


class Worker:
    """A process that runs scenarios, and is replaced when it dies or does not end."""

    def __init__(self, folder: Path) -> None:
        self._folder, self._process, self._done = folder, None, 0

    def __enter__(self) -> Worker:
        return self

    def __exit__(self, *_: object) -> None:
        self._end()

    def _end(self) -> None:
        if self._process is not None:
            with contextlib.suppress(psutil.Error):
                for child in psutil.Process(self._process.pid).children(recursive=True):
                    child.kill()
            self._process.kill()
            with self._process:  # closes its pipes
                self._process = None

    def _start(self) -> subprocess.Popen[bytes]:
        folder = Path(tempfile.mkdtemp(dir=self._folder))
        self._stacks = folder / "stacks"
        self._stacks.touch()
        self._done = 0
        return subprocess.Popen(
            [sys.executable, "-m", "tests.fuzz.judging", "--serve", str(folder)],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0, cwd=Path(__file__).parents[2],
        )  # fmt: skip

    def run(self, number: int) -> Case:
        """Runs a scenario within its time; its forecast is asked for only where it is needed."""
        case = self._answer(number, str(number), TIMES * FLOOR_S)
        if case.code == ENDLESS:
            plan = self._answer(number, f"plan {number}", TIMES * FLOOR_S)
            if plan.code != ENDLESS and plan.seconds > 0:
                case = self._answer(number, str(number), TIMES * (FLOOR_S + plan.seconds))
        return case

    def _answer(self, number: int, request: str, limit: float) -> Case:
        if self._process is None or self._done >= KEPT:
            self._end()
            self._process = self._start()
        self._done += 1
        process = self._process
        assert process.stdin is not None and process.stdout is not None
        process.stdin.write(f"{request}\n".encode())
        os.set_blocking(process.stdout.fileno(), False)
        began, used, answer = _used(process.pid), 0.0, b""
        marked, spent = time.monotonic(), 0.0
        while True:
            answer += process.stdout.read() or b""
            if answer.endswith(b"\n"):
                return Case(**json.loads(answer))
            if process.poll() is not None:
                self._end()
                return Case(number, wrong=[f"the process ended with {process.returncode}"])
            used, now = _used(process.pid) - began, time.monotonic()
            idle = now - marked > IDLE_S and used - spent < 0.01 * IDLE_S
            if now - marked > IDLE_S:
                marked, spent = now, used
            if used > limit or idle:
                process.send_signal(signal.SIGRTMIN)  # it writes where it is; LLVM takes SIGUSR1
                time.sleep(1)
                where = self._stacks.read_text()[-3000:]
                self._end()
                return Case(number, ENDLESS, used, wrong=[f"not ended in {used:.0f} s: {where}"])
            time.sleep(0.02)


def _used(pid: int) -> float:
    """Processor time of a process and its children."""
    with contextlib.suppress(psutil.Error):
        whole = psutil.Process(pid)
        times = [p.cpu_times() for p in (whole, *whole.children(recursive=True))]
        return sum(t.user + t.system + t.children_user + t.children_system for t in times)
    return 0.0


def run_all(numbers: Iterable[int], folder: Path) -> list[Case]:
    """Runs scenarios one after another."""
    with Worker(folder) as worker:
        return [worker.run(number) for number in numbers]


def _few_probes(number: int) -> contextlib.AbstractContextManager[object]:
    """A display in fifty has all its probes, which take most of the time; the others have few."""
    few = {
        "RATES": (metrics.GREY, metrics.BRIGHT), "EDGES": ((0.0, metrics.GREY),), "PST_CLOCK": 0.0,
    }  # fmt: skip
    return mock.patch.multiple(metrics, **few) if number % 50 else contextlib.nullcontext()


def _serve(folder: Path) -> None:
    """Answers requests, a line each, "N" or "plan N", with a case as JSON."""
    with os.fdopen(os.dup(1), "w") as answers, (folder / "stacks").open("w") as stacks:
        os.dup2(2, 1)
        faulthandler.register(signal.SIGRTMIN, stacks, all_threads=True)
        make_ready(folder)
        for line in sys.stdin:
            *plan, number = line.split()
            case = Case(int(number))
            if plan:
                case.seconds = forecast(case.number, folder, case)
            else:
                case = run_case(case.number, folder)
            answers.write(json.dumps(vars(case)) + "\n")
            answers.flush()


if __name__ == "__main__":
    if sys.argv[1] == "--serve":
        _serve(Path(sys.argv[2]))
    else:
        with tempfile.TemporaryDirectory() as place:
            make_ready(Path(place))
            for number in map(int, sys.argv[1:]):
                drawn = draw(number)
                print(tomli_w.dumps(drawn.data), *drawn.options)
                print(json.dumps(vars(run_case(number, Path(place))), indent=1))
