"""`viform board`: low latency on ports that have none, logs that know their session, and Verilog
that does not compile."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import time

import pytest

from rtl_model.host import ReplayPort
from rtl_model.verilated import VERILOG
from rtl_model.virtual import VirtualBoard
from tests.rtl_model.host.rfc2217_server import Rfc2217Server
from tests.rtl_model.virtual.hosts import needs_verilator

MODEL = ("--port", "virtual", "--level", "model")


def test_a_port_without_low_latency_is_told_in_a_line(viform):
    with VirtualBoard(level="model") as board:
        code, out, err = viform(
            "board", "identify", "--port", board.port, "--time-scale", board.time_scale,
            "--low-latency", "--json",
        )  # fmt: skip
    assert (code, json.loads(out)["ok"]) == (0, True)
    assert err == (
        f"viform: {board.port} has no low-latency mode, like all ptys and sockets; "
        "continuing without it\n"
    )


def test_a_replay_is_of_what_was_there(viform, tmp_path):
    log = tmp_path / "line.jsonl"
    code, _, _ = viform(
        "board", "bringup", *MODEL, "--fault", "foreign", "--log", log, "--frames", "3"
    )
    assert code == 1
    port = ReplayPort(log)
    assert (port.simulated, port.frames) == (True, 3)
    lines = log.read_text().splitlines()
    real = json.loads(lines[0]) | {"simulated": False, "port": "/dev/ttyUSB0"}
    for first, simulated in ((real, False), ({**real, "port": "/dev/pts/7"}, True)):
        if simulated:  # of an old log only the name tells
            del first["simulated"], first["time_scale"], first["frames"]
        log.write_text("\n".join([json.dumps(first), *lines[1:]]) + "\n")
        code, out, _ = viform("board", "replay", log, "--bringup", "--json")
        document = json.loads(out)
        assert (code, document["kind"]) == (1, "foreign")
        assert document["simulated"] is simulated


@needs_verilator
def test_verilog_that_does_not_compile_is_one_line(refused, tmp_path):
    for path in VERILOG.iterdir():
        shutil.copy(path, tmp_path)
    core = tmp_path / "viform_system.v"
    core.write_text(core.read_text().replace("endmodule", "wire wire;\nendmodule", 1))
    said = refused("board", "compare", "--lockstep", "--sources", tmp_path, "--pixels", "1e4")
    assert "must be Verilog that compiles, not refused: viform_system.v:" in said
    assert "syntax error" in said and "failed-verilator.log" in said


@needs_verilator
def test_a_folder_without_the_verilog_is_one_line(refused, tmp_path):
    said = refused("board", "compare", "--lockstep", "--sources", tmp_path, "--pixels", "1e4")
    assert "must be one with a readable viform_system.v" in said


@pytest.mark.slow
@needs_verilator
def test_a_slow_baud_passes(viform):
    code, out, err = viform("board", "bringup", "--port", "virtual", "--baud", "9600", "--json")
    assert code == 0, json.loads(out)["cause"] + err


def test_lockstep_has_no_port(refused, tmp_path):
    said = refused("board", "compare", "--lockstep", "--port", "/dev/ttyUSB0")
    assert "options of the line must be left out with --lockstep" in said


def test_waveforms_of_lockstep_need_their_folder_before_it_begins(refused, tmp_path):
    said = refused("board", "compare", "--lockstep", "--trace", tmp_path / "none" / "a.fst")
    assert "--trace must be in a folder that exists" in said


def test_a_request_to_end_is_met_where_ctrl_c_is_ignored(tmp_path):
    """A script's `viform board virtual &` has SIGINT ignored; `kill` ends it all the same."""
    link = tmp_path / "port"
    words = [
        sys.executable, "-c", "from scenarios.cli import main; main()",
        "board", "virtual", "--level", "model", "--link", str(link),
    ]  # fmt: skip
    shell = ["sh", "-c", 'trap "" INT; exec "$@"', "sh", *words]
    with subprocess.Popen(shell, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as made:
        try:
            for _ in range(300):
                if link.is_symlink():
                    break
                time.sleep(0.1)
            made.terminate()
            made.wait(20)
        finally:
            made.kill()
    assert not link.is_symlink()


@pytest.mark.slow
def test_a_damaged_log_is_one_line_and_a_cut_one_is_replayed(viform, refused, tmp_path):
    log = tmp_path / "line.jsonl"
    assert viform("board", "bringup", *MODEL, "--log", log, "--frames", "1")[0] == 0
    lines = log.read_text().splitlines()
    log.write_text("\n".join(lines)[:-20])
    code, out, _ = viform("board", "replay", log)
    assert code == 0
    assert out.endswith(
        f"{len(lines) - 1} events, 0 answers with a fault, the last line is cut off\n"
    )
    requests = [n for n, line in enumerate(lines) if '"event": "write"' in line]

    def edit(n: int, key: str, value: object) -> None:
        edited = [*lines[:n], json.dumps(json.loads(lines[n]) | {key: value}), *lines[n + 1 :]]
        log.write_text("\n".join(edited) + "\n")

    for key, value in (("address", "zero"), ("monotonic", 10**400), ("words", "two")):
        edit(requests[20], key, value)
        said = refused("board", "replay", log, "--bringup")
        assert f"line {requests[20] + 1} of {log} must be an event" in said
    for n in (requests[0], requests[20], requests[-1]):
        edit(n, "hex", "0201000000ff")
        code, out, err = viform("board", "replay", log, "--bringup")
        assert (
            code in (1, 2) and f"line {n + 1} of the replay of {log}: the host sends" in out + err
        )


@pytest.mark.slow
def test_a_board_behind_a_serial_server_passes(viform):
    """RFC 2217, negotiated; a socket does not say that a simulated board is behind it."""
    with VirtualBoard(level="model") as board, Rfc2217Server(board.port) as server:
        line = ("--port", server.url, "--time-scale", board.time_scale, "--simulated")
        for command in ("identify", "regs", "prbs"):
            code, out, _ = viform("board", command, *line, "--json")
            assert (code, json.loads(out)["ok"]) == (0, True)
        code, out, _ = viform("board", "bringup", *line, "--frames", "1", "--json")
        document = json.loads(out)
        assert (code, document["simulated"]) == (0, True)
        assert {stage["outcome"] for stage in document["stages"]} == {"ok"}
    assert server.bauds == [9600, 115_200]


@pytest.mark.parametrize(
    "words",
    [
        ("prbs", "--words", "8"),
        ("regs", "--set", "sensor_threshold=3"),
        ("capture", "--frames", "1", "--out", "a.npz"),
        ("compare", "--frames", "1"),
    ],
)
def test_nothing_is_written_to_a_foreign_design(viform, tmp_path, monkeypatch, words):
    monkeypatch.chdir(tmp_path)
    log = tmp_path / "line.log"
    with VirtualBoard(level="model", faults=("foreign",)) as board:
        line = (*words, "--port", board.port, "--time-scale", board.time_scale, "--log", log)
        code, out, err = viform("board", *line)
        assert (code, out) == (1, "")
        assert "another design answers, and nothing was written to it; give the csr.csv" in err
        assert '"command": "write' not in log.read_text()
        viform("board", *line, "--force")
        # A burst needs the size of a Viform board, which another design does not state.
        assert ('"command": "write' in log.read_text()) == (words[0] in ("prbs", "regs"))
