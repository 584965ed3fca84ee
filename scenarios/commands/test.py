"""`viform test`: the checks of this project: ruff, mypy, pytest."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import typer

from scenarios.commands.output import Json, print_document

__all__ = ["test"]

# Files stay whole, so that what a file's tests share is made once.
_SPREAD = ["-n", str(min(os.cpu_count() or 1, 4)), "--dist", "loadfile"]
_STATIC = {"ruff": ["ruff", "check", "."], "mypy": ["mypy"]}


def _counts(junit: Path) -> dict[str, int]:
    """Tests passed, failed and skipped, from pytest's own record."""
    if not junit.exists():
        return {"passed": 0, "failed": 0, "skipped": 0}
    suites = list(ElementTree.parse(junit).getroot().iter("testsuite"))

    def total(name: str) -> int:
        return sum(int(suite.get(name, 0)) for suite in suites)

    failed, skipped = total("failures") + total("errors"), total("skipped")
    return {"passed": total("tests") - failed - skipped, "failed": failed, "skipped": skipped}


def test(context: typer.Context, json: Json = False) -> None:
    """Run the tests; arguments after `test` go to pytest, and then it alone is run.

    `viform test -m slow` runs the long proofs.
    """
    from cosim import InputError

    root = Path(__file__).resolve().parents[2]
    if not (root / "tests").is_dir():
        raise InputError(
            "viform test", "run from a clone", "from an installed copy", "clone the project"
        )
    extra = list(context.args)
    began = time.perf_counter()
    # With --json standard output belongs to the document.
    sink: Any = sys.stderr if json else None
    checks: dict[str, bool] = {}
    if not extra:
        for name, words in _STATIC.items():
            print(f"viform: {name}", file=sys.stderr, flush=True)
            done = subprocess.run([sys.executable, "-m", *words], cwd=root, stdout=sink)
            checks[name] = done.returncode == 0
    with tempfile.TemporaryDirectory() as folder:
        junit = Path(folder) / "junit.xml"
        words = [sys.executable, "-m", "pytest", f"--junitxml={junit}", *(extra or _SPREAD)]
        print("viform: pytest", file=sys.stderr, flush=True)
        checks["pytest"] = subprocess.run(words, cwd=root, stdout=sink).returncode == 0
        counts = _counts(junit)
    if json:
        print_document({**counts, "checks": checks, "seconds": time.perf_counter() - began})
    broken = [name for name, fine in checks.items() if not fine]
    if broken:
        print(f"viform: failed: {', '.join(broken)}", file=sys.stderr)
        raise typer.Exit(1)
