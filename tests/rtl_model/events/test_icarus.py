"""Encoder and decoder in a second simulator, Icarus, one behind the other."""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from rtl_model.events.encoder import EventSize
from rtl_model.events.rates import steady_words, tiles_of
from rtl_model.verilated import VERILOG
from sensor.codec.packets.event import encode_events, packet_of_line

BENCH = Path(__file__).with_name("bench.v")
SIZE = EventSize(4, 40, 32, 32, 64, tile=9)
PACKETS, TICK = 20, 200


@pytest.mark.skipif(shutil.which("iverilog") is None, reason="needs the system package iverilog")
def test_packets_are_the_coders_and_come_back_in_icarus(tmp_path):
    words = steady_words(SIZE, 32 * (PACKETS + 1), 0.1, 0.5, 0.2, 1)
    tiles = tiles_of(words, SIZE, TICK, clock=2000)
    (tmp_path / "tiles.hex").write_text(
        "\n".join(
            f"{int(t['clock']):08x}{int(t['frame']):08x}{int(t['row']):04x}{int(t['tile']):04x}"
            f"{int(t['bits']):08x}"
            for t in tiles
        )
    )
    memories = [VERILOG / f"viform_{name}.v" for name in ("fifo", "ram")]
    sources = [*sorted(VERILOG.glob("viform_event_*.v")), *memories, BENCH]
    clocks = int(tiles["clock"][-1]) + 3000
    command = [
        "iverilog",
        "-g2005",
        "-Wall",
        "-Wno-timescale",
        "-I",
        str(VERILOG),
        "-s",
        "bench",
        "-o",
        "bench.vvp",
    ]
    command += [f"-Pbench.TILES={len(tiles)}", f"-Pbench.CLOCKS={clocks}", *map(str, sources)]
    built = subprocess.run(
        command, cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False
    )
    assert (built.returncode, built.stderr) == (0, "")
    run = subprocess.run(
        ["vvp", "-n", "bench.vvp"], cwd=tmp_path, capture_output=True, text=True, timeout=120,
        check=True,
    )  # fmt: skip
    lines = [line.split() for line in run.stdout.splitlines()]
    assert lines[-1] == ["done", str(PACKETS), "0", "0", "0"]
    data, packets = b"", []
    for _, half, last in (line for line in lines if line[0] == "e"):
        data += int(half, 16).to_bytes(2, "little")
        if last == "1":
            packets.append(packet_of_line(data))
            data = b""
    assert [(p.first, p.tile) for p in packets] == [(32 * n, 9) for n in range(PACKETS)]
    assert [p.data for p in packets] == [
        encode_events(words[n : n + 1], 32) for n in range(PACKETS)
    ]
    out = [line[1:] for line in lines if line[0] == "d"]
    assert np.array_equal(
        np.array([int(word, 16) for word, *_ in out], np.uint32), words[:PACKETS].reshape(-1)
    )
    assert {(last, user) for _, last, user, *_ in out[SIZE.pixels - 1 :: SIZE.pixels]} == {
        ("1", "0")
    }
    assert not any(line[0] == "g" for line in lines)
