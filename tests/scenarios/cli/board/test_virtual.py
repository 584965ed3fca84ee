"""`viform board virtual`: one document when it is ready, an end without traces, one line for what
is wrong."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from rtl_model.geometry import Geometry
from rtl_model.registers import csr_csv

COMMAND = [sys.executable, "-c", "from scenarios.cli import main; main()", "board", "virtual"]


def test_it_serves_until_it_is_interrupted(tmp_path: Path) -> None:
    link, csr = tmp_path / "tty", tmp_path / "csr.csv"
    options = ["--level", "model", "--rows", "4", "--json", "--link", str(link), "--csr", str(csr)]
    child = subprocess.Popen(
        [*COMMAND, *options], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
        # A suite that runs in a script's background has SIGINT ignored, and children inherit it.
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )  # fmt: skip
    try:
        assert child.stdout is not None
        text = ""
        while not text.endswith("}\n") or text.count("{") > text.count("}"):
            line = child.stdout.readline()
            assert line, child.stderr.read() if child.stderr else ""
            text += line
        document = json.loads(text)
        assert document["port"] == str(link)
        assert link.stat().st_mode & 0o777 == 0o600  # nobody else writes to the board
        assert document["geometry"]["rows"] == 4
        assert document["time_scale"] >= 1.0
        geometry = Geometry(**document["geometry"])
        assert Path(document["csr"]).read_text() == csr_csv(geometry)
        for _ in range(3):  # a user who is in a hurry
            child.send_signal(signal.SIGINT)
            time.sleep(0.03)
        _, errors = child.communicate(timeout=60)
        assert errors == ""
        assert child.returncode in (0, -signal.SIGINT)  # the last one may come after its end
        assert not os.path.lexists(link)
    finally:
        child.kill()


@pytest.mark.parametrize(
    "options",
    [
        ("--fault", "drop"),
        ("--fault", "baud=6", "--level", "model"),
        ("--level", "gates"),
        ("--lanes", "48"),
        ("--baud", "9000000"),
        ("--level", "model", "--link", "/no/such/folder/tty"),
        ("--fault", "stuck=2,40", "--columns", "40"),
    ],
)
def test_bad_input_is_one_line(
    options: tuple[str, ...], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from scenarios.cli.entry import main

    monkeypatch.setattr(sys, "argv", ["viform", "board", "virtual", *options])
    monkeypatch.setattr("cosim.compute.stopping.end_on_signals", lambda: None)
    handler = signal.getsignal(signal.SIGTERM)
    try:
        with pytest.raises(SystemExit) as ended:
            main()
    finally:
        signal.signal(signal.SIGTERM, handler)
    said = capsys.readouterr()
    assert ended.value.code == 2
    assert said.out == ""
    assert said.err.count("\n") == 1


def test_a_model_is_compiled_before_a_host_waits_for_its_first_frame():
    """The first frame loads the compiled scan, which took half a second beside a host's timeout."""
    check = """
from rtl_model.virtual import VirtualBoard
with VirtualBoard(level="model") as board:
    from rtl_model.cycle.scan import scan
    assert scan.signatures and board.clock < 10_000_000
"""
    subprocess.run([sys.executable, "-c", check], check=True)
