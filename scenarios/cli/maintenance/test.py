"""`viform test`: the checks of this project: ruff, mypy, pytest."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import typer

from cosim.compute.cores import cores
from scenarios.cli.output import Json, print_document
from scenarios.cli.start import has_launcher, install_and_restart

# Each worker has a contiguous part of the tests, because those of a file share fixtures and
# compiled kernels. A worker that is done takes over tests of another.
_SPREAD = ["-n", str(min(cores(), 4)), "--dist", "worksteal"]
_STATIC = {"ruff": ["ruff", "check", "."], "mypy": ["mypy"]}


def _counts(junit: Path) -> dict[str, int]:
    """Numbers of tests passed, failed and skipped, from the JUnit file of pytest."""
    if not junit.exists():
        return {"passed": 0, "failed": 0, "skipped": 0}
    suites = list(ElementTree.parse(junit).getroot().iter("testsuite"))

    def total(name: str) -> int:
        return sum(int(suite.get(name, 0)) for suite in suites)

    failed, skipped = total("failures") + total("errors"), total("skipped")
    return {"passed": total("tests") - failed - skipped, "failed": failed, "skipped": skipped}


def _begin(
    root: Path, folder: Path, running: ExitStack
) -> dict[str, tuple[subprocess.Popen[bytes], Path]]:
    """Starts the static checks; returns the process and the output file of each. `running` ends the
    processes."""
    started = {}
    for name, words in _STATIC.items():
        output = folder / name
        with output.open("wb") as sink:
            process = subprocess.Popen(
                [sys.executable, "-m", *words], cwd=root, stdout=sink, stderr=subprocess.STDOUT
            )
        running.callback(process.wait)
        running.callback(process.kill)
        started[name] = process, output
    return started


def _missing_packages() -> list[str]:
    """System packages that tests need and that are not installed. Tests that need them are
    skipped."""
    from cosim.compute.opencl import opencl_packages, probe
    from display import probe_gl
    from display.render.context import gl_packages
    from rtl_model.verilated.build import PACKAGES

    missing = [] if probe() else [*opencl_packages()]
    missing += [] if probe_gl()[0] else gl_packages()
    programs = {
        **PACKAGES, "iverilog": "iverilog", "yosys": "yosys",
        "chromium": "chromium", "chromedriver": "chromium-driver",
    }  # fmt: skip
    missing += [package for name, package in programs.items() if shutil.which(name) is None]
    return [*missing, "zlib1g-dev"] if "verilator" in missing else missing


def test(context: typer.Context, json: Json = False) -> None:
    """Run ruff, mypy and pytest; with arguments after `test`, run only pytest with them.

    `viform test -m slow` runs the slow tests.
    """
    from cosim import InputError

    root = Path(__file__).resolve().parents[3]
    if not (root / "tests").is_dir():
        raise InputError(
            "viform test", "run from a clone", "from an installed copy", "clone the project"
        )
    if has_launcher():
        install_and_restart(_missing_packages())
    extra = list(context.args)
    began = time.perf_counter()
    # With --json standard output belongs to the document.
    sink: Any = sys.stderr if json else None
    checks: dict[str, bool] = {}
    with tempfile.TemporaryDirectory() as folder, ExitStack() as running:
        junit = Path(folder) / "junit.xml"
        # The static checks run in parallel with pytest, and their output is printed at the end.
        static = {} if extra else _begin(root, Path(folder), running)
        words = [sys.executable, "-m", "pytest", f"--junitxml={junit}", *(extra or _SPREAD)]
        print(f"viform: {', '.join([*static, 'pytest'])}", file=sys.stderr, flush=True)
        checks["pytest"] = subprocess.run(words, cwd=root, stdout=sink).returncode == 0
        for name, (process, output) in static.items():
            checks[name] = process.wait() == 0
            text = output.read_text(encoding="utf-8", errors="replace").rstrip()
            print(f"viform: {name}\n{text}", file=sys.stderr if json else sys.stdout, flush=True)
        counts = _counts(junit)
    if json:
        print_document({**counts, "checks": checks, "seconds": time.perf_counter() - began})
    failed = [name for name, passed in checks.items() if not passed]
    if failed:
        print(f"viform: failed: {', '.join(failed)}", file=sys.stderr)
        raise typer.Exit(1)
