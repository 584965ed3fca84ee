"""What a command leaves, as a document that two versions of the program can be compared by.

Times, devices and the program's version are left out: everything else is a function of the inputs.
`python tests/recorded/recording.py [WORDS]` writes recorded.json anew for the cases whose
names hold all the words.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import re
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import zarr

from cosim.run.result import NO_REASON
from scenarios.cli.entry import _main

RECORDED = Path(__file__).with_name("recorded.json")
TIMED = frozenset({
    "version", "device", "renderer", "run_time_s", "throughput", "camera", "full_physics",
    "predicted", "ns_per_pixel_cycle", "cost_ns", "seconds", "round_trips_per_s",
    "capture_bytes_per_s", "ns_per_interval",
    # Prose: texts may be improved.
    "description", "reason",
})  # fmt: skip
"""Keys whose values depend on the machine or its load, and prose."""


LONG = 400
"""Items of a list from which on its digest is kept in its place."""


def plain(value: Any) -> Any:
    """A document without what depends on the machine; long lists as digests."""
    if isinstance(value, dict):
        return {key: plain(inner) for key, inner in value.items() if key not in TIMED}
    if isinstance(value, list) and len(value) > LONG:
        return f"{len(value)} items, {hashlib.sha256(_rounded(value).encode()).hexdigest()}"
    if isinstance(value, list):
        return [plain(inner) for inner in value]
    return value


def _rounded(value: Any) -> str:
    """Text of a value, its floats to nine digits."""
    if isinstance(value, float):
        return f"{value:.9g}"
    if isinstance(value, dict):
        return str([(key, _rounded(inner)) for key, inner in value.items() if key not in TIMED])
    return str([_rounded(inner) for inner in value]) if isinstance(value, list) else str(value)


def _hash(*arrays: Any) -> str:
    digest = hashlib.sha256()
    for array in arrays:
        whole = np.ascontiguousarray(array)
        digest.update(f"{whole.dtype.str} {whole.shape}".encode())
        digest.update(whole.tobytes())
    return digest.hexdigest()


def _stored(path: Path) -> dict[str, str]:
    """SHA-256 of every array of a Zarr group or an .npz."""
    if path.suffix == ".npz":
        with np.load(path) as arrays:
            return {name: _hash(arrays[name]) for name in sorted(arrays.files)}
    group = zarr.open_group(path, mode="r")
    return {name: _hash(array[...]) for name, array in sorted(group.arrays())}


def left_behind(folder: Path) -> dict[str, Any]:
    """What stands in a run's folder: the stream by its values, pictures by theirs, pages by what
    they are made of."""
    found: dict[str, Any] = {}
    for path in sorted(folder.iterdir()):
        if path.suffix in (".zarr", ".npz"):
            found[path.name] = _stored(path)
        elif path.suffix == ".toml":
            found[path.name] = path.read_text(encoding="utf-8")
        elif path.name == "report.html":
            page = path.read_text(encoding="utf-8")
            heads = re.findall(r"<h[123][^>]*>(.*?)</h[123]>", page, re.S)
            found[path.name] = [re.sub(r"\s+", " ", head) for head in heads]
    for path in sorted([*folder.glob("images/*.png"), *folder.glob("received/*")]):
        found[str(path.relative_to(folder))] = hashlib.sha256(path.read_bytes()).hexdigest()
    return found


def record(words: tuple[str, ...], folder: Path) -> dict[str, Any]:
    """Runs a command and says what it printed and left. folder: for a run's own, not there yet."""
    arguments = [*words, *(() if "--schema" in words else ("--json",))]
    if words[0] == "run":
        arguments += ["--out", str(folder)]
    out = io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(io.StringIO()) as err:
        code = _main(arguments)
    if not out.getvalue():
        return {"code": code, "says": err.getvalue()}
    assert NO_REASON not in out.getvalue(), "a metric without a figure says why"
    document = plain(json.loads(out.getvalue()))
    if words[0] != "run":
        return {"code": code, "document": document}
    return {"code": code, "document": document, "left": left_behind(folder)}


def differences(was: Any, now: Any, where: str = "") -> list[str]:
    """Where two documents differ, a line each. Numbers may differ by 1e-6, or by 1e-12 where they
    are nearly 0: vector units of different widths add in different orders, and a small error is
    the difference of large sums. Streams and pictures are compared by their bits."""
    if isinstance(was, dict) and isinstance(now, dict):
        return [
            line
            for key in dict.fromkeys([*was, *now])
            for line in (
                differences(was[key], now[key], f"{where}/{key}")
                if key in was and key in now
                else [f"{where}/{key}: {'is gone' if key in was else 'is new'}"]
            )
        ]
    if isinstance(was, list) and isinstance(now, list) and len(was) == len(now):
        pairs = enumerate(zip(was, now, strict=True))
        return [line for n, (a, b) in pairs for line in differences(a, b, f"{where}/{n}")]
    if isinstance(was, float) and isinstance(now, float) and np.isclose(was, now, 1e-6, 1e-12):
        return []
    return [] if was == now else [f"{where}: {str(was)[:200]} became {str(now)[:200]}"]


def main(words: list[str]) -> None:
    """Writes recorded.json anew for the cases whose names hold all the words."""
    from cases import CASES  # type: ignore[import-not-found]

    known = json.loads(RECORDED.read_text()) if RECORDED.exists() else {}
    for case in CASES:
        if all(word in case.name for word in words):
            print(case.name, flush=True)
            with tempfile.TemporaryDirectory() as place:
                known[case.name] = record(case.words, Path(place) / "run")
            RECORDED.write_text(json.dumps(known, indent=1, ensure_ascii=False) + "\n")


if __name__ == "__main__":
    main(sys.argv[1:])
