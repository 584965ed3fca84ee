"""`viform board` over UDP: every command of a port, and wrong addresses in one line."""

import json
import socket
import threading

import pytest

from rtl_model.geometry import Geometry
from rtl_model.virtual.ethernet import EthernetBoard

SIZE = Geometry(rows=4, columns=40, lanes=32, clock_hz=460_800, capture_words=512, sink_words=64)


@pytest.fixture(scope="module")
def port():
    with EthernetBoard("udp:127.0.0.1:0", SIZE, level="model") as board:
        yield board.port


def document(viform, *arguments):
    code, out, err = viform(*arguments, "--json")
    assert code == 0, err
    return json.loads(out)


def test_commands_that_take_a_port_take_a_udp_address(viform, refused, port, tmp_path):
    told = document(viform, "board", "identify", "--port", port)
    assert (told["port"], told["baud"], told["ours"]) == (port, None, True)
    assert (told["board"]["rows"], told["board"]["baud"]) == (4, None)
    assert "baud" not in viform("board", "identify", "--port", port)[1]
    log = tmp_path / "line.jsonl"
    regs = ("board", "regs", "--port", port, "--set", "sensor_threshold=3", "sensor_threshold")
    told = document(viform, *regs, "--log", log)
    assert [row["value"] for row in told["registers"]] == [3]
    assert document(viform, "board", "prbs", "--port", port, "--order", 7, "--words", 300)["ok"]
    stream = tmp_path / "burst.npz"
    told = document(viform, "board", "capture", "--port", port, "--frames", 9, "--out", stream)
    assert (told["frames"], told["height"], told["width"]) == (9, 4, 40)
    compare = ("board", "compare", "--port", port, "--set", "sensor_pattern=2")
    assert document(viform, *compare, "--set", "sensor_level=99")["ok"]
    told = document(viform, "board", "replay", log)
    assert any("writes" in event["text"] for event in told["events"])
    assert "a serial line" in refused("board", "replay", log, "--bringup")


@pytest.mark.parametrize(
    ("address", "says"),
    [
        ("udp:no-such-host.invalid", "must be a name or an address that is found"),
        ("udp:127.0.0.1:1", "no program listens at udp:127.0.0.1:1"),
        ("udp:127.0.0.1:abc", "must be a number from 1 to 65535, not 'abc'"),
        ("udp:", "must be udp:HOST or udp:HOST:PORT"),
    ],
)
@pytest.mark.parametrize("command", ["identify", "bringup"])
def test_a_wrong_address_is_one_line_and_exit_2(refused, monkeypatch, address, says, command):
    monkeypatch.setattr("rtl_model.host.ether.etherbone._PROBE_WAIT_S", 0.01)
    assert says in refused("board", command, "--port", address)


def test_a_board_that_does_not_answer_says_what_to_check(refused, monkeypatch):
    monkeypatch.setattr("rtl_model.host.ether.etherbone._PROBE_WAIT_S", 0.01)
    monkeypatch.setattr("rtl_model.host.bone.SIMULATED_PATIENCE_S", 0.1)
    with EthernetBoard("udp:127.0.0.1:0", SIZE, level="model", faults=["silent"]) as board:
        told = refused("board", "identify", "--port", board.port)
    assert "IP address" in told and "firewall" in told


def test_a_program_that_is_no_board_is_not_called_silent(refused, monkeypatch):
    monkeypatch.setattr("rtl_model.host.ether.etherbone._PROBE_WAIT_S", 0.01)
    monkeypatch.setattr("rtl_model.host.bone.SIMULATED_PATIENCE_S", 0.1)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as udp:
        udp.bind(("127.0.0.1", 0))

        def echo():
            while (taken := udp.recvfrom(100))[0] != b"end":
                udp.sendto(taken[0], taken[1])

        thread = threading.Thread(target=echo)
        thread.start()
        try:
            told = refused("board", "identify", "--port", f"udp:127.0.0.1:{udp.getsockname()[1]}")
        finally:
            udp.sendto(b"end", udp.getsockname())
            thread.join()
    assert "another program's or design's (8 datagrams" in told and "silent" not in told


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--udp", "127.0.0.1", "--level", "pins"], "of level bytes or model"),
        (["--udp", "127.0.0.1", "--fault", "drop:rx@3"], "faults of a serial line"),
        (["--udp", "127.0.0.1", "--link", "x"], "--link must be left out with --udp"),
        (["--udp", "127.0.0.1:x"], "must be a number from 0"),
        (["--udp", "192.0.2.1", "--level", "model"], "must be an address of this machine"),
    ],
)
def test_a_virtual_board_that_cannot_be_is_refused(refused, options, says):
    assert says in refused("board", "virtual", *options, "--json")
