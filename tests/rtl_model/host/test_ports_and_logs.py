"""Ports of every kind with their faults; logs, and their replay without a board."""

import json
import os
import pty
import socket
import subprocess
import sys
import threading
import tty

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cosim import InputError
from rtl_model.host import (
    Board,
    Cause,
    LineFault,
    LineLog,
    Lines,
    ReplayPort,
    Uartbone,
    capture,
    find_baud,
    open_port,
    prbs,
)
from rtl_model.host.ports import latency_timer

MAGIC = bytes.fromhex("53504b32")


@pytest.fixture
def terminal():
    master, slave = pty.openpty()
    tty.setraw(slave)
    yield master, os.ttyname(slave)
    os.close(master)
    os.close(slave)


def test_a_pty_with_its_traps(terminal):
    master, name = terminal
    port = open_port(name, 1_234_567)  # any baud, exclusively
    assert port.modem_lines() is None  # ENOTTY
    assert latency_timer(port.name)[1] is None and port.low_latency() is False  # ValueError
    port.write(b"ask")
    assert os.read(master, 9) == b"ask"
    os.write(master, b"answer")
    assert port.read(6, 1.0) == b"answer"
    assert port.read(3, 0.02) == b""
    with pytest.raises(LineFault) as fault:
        open_port(name, 115_200)
    assert fault.value.cause is Cause.BUSY
    port.close()
    port.close()


def test_a_port_that_is_gone_is_not_a_bad_baud():
    master, slave = pty.openpty()
    tty.setraw(slave)
    port = open_port(os.ttyname(slave), 115_200)
    os.close(master)
    with pytest.raises(LineFault) as fault:
        port.set_baud(9600)
    assert fault.value.cause is Cause.GONE
    port.close()
    os.close(slave)


def test_a_write_that_nobody_takes_ends(terminal):
    _, name = terminal
    port = open_port(name, 115_200)
    with pytest.raises(LineFault) as fault:
        port.write(bytes(1 << 20), 0.05)
    assert fault.value.cause is Cause.STUCK
    port.close()


def test_ports_that_are_none(tmp_path):
    plain = tmp_path / "file"
    plain.write_text("")
    absent = ("/dev/no-such-port", "socket://localhost:1", "hwgrep://no-such-port")
    for url in (*absent, str(plain), str(tmp_path)):
        with pytest.raises(LineFault) as fault:
            open_port(url, 115_200)
        assert fault.value.cause is Cause.NO_PORT
        assert "ports here: " in str(fault.value) and "\n" not in str(fault.value)
    for url, baud in (
        ("nothing://x", 9600),
        ("loop://", 0),
        ("socket://", 9600),
        ("hwgrep://[", 9600),
    ):
        with pytest.raises((InputError, LineFault)):
            open_port(url, baud)


def test_permission_names_the_group(monkeypatch, tmp_path):
    import serial

    def refuse(self):
        raise serial.SerialException(13, "could not open port: Permission denied")

    monkeypatch.setattr(serial.Serial, "open", refuse)
    with pytest.raises(LineFault) as fault:
        open_port("/dev/ttyUSB0", 115_200)
    assert fault.value.cause is Cause.PERMISSION and "usermod -aG" in str(fault.value)


@pytest.mark.parametrize("given", [{}, {"dtr": "off"}, {"dtr": "off", "rts": "off"}, {"rts": "on"}])
def test_modem_lines_are_set_as_the_port_opens(monkeypatch, terminal, given):
    """Some boards reset by them. A pty has none: what is asked of it is seen here."""
    import serial

    asked = {}
    for name in ("dtr", "rts"):
        monkeypatch.setattr(
            serial.Serial, f"_update_{name}_state",
            lambda port, name=name: asked.setdefault(name, getattr(port, f"_{name}_state")),
        )  # fmt: skip
    open_port(terminal[1], 115_200, lines=Lines(**given)).close()
    assert asked == {name: given.get(name, "on") == "on" for name in ("dtr", "rts")}


def test_an_echo_is_told():
    for words in (1, 3):
        with pytest.raises(LineFault) as fault:
            Uartbone(open_port("loop://", 115_200)).read(0, words)
        assert fault.value.cause is Cause.ECHO


def test_a_socket_that_answers_and_goes_away():
    server = socket.create_server(("localhost", 0))

    def serve():
        line, _ = server.accept()
        with line:
            assert line.recv(6) == bytes.fromhex("020100000000")
            line.sendall(MAGIC)
            line.recv(6)

    thread = threading.Thread(target=serve)
    thread.start()
    bone = Uartbone(open_port(f"socket://localhost:{server.getsockname()[1]}", 115_200))
    assert bone.read(0) == [0x53504B32]
    with pytest.raises(LineFault) as fault:
        bone.read(0)
    assert fault.value.cause in (Cause.GONE, Cause.SILENT)
    thread.join()
    server.close()


def test_a_dead_board_is_silent_and_soon_said_to_be(port):
    port.dead = True
    with pytest.raises(LineFault) as fault:
        Board(Uartbone(port)).info()
    assert fault.value.cause is Cause.SILENT and port.now() < 4
    with pytest.raises(LineFault, match="no Viform board answers on model within 20 %"):
        find_baud(port, 50_000)


def test_transactions_stay_under_50_ms_and_255_words(port):
    for baud in (2400, 9600, 57_600, 115_200, 3_000_000, 12_000_000):
        port.baud = baud
        words = Uartbone(port).words_at_once
        assert 1 <= words <= 255
        assert words == 255 or 10 * (6 + 4 * (words + 1)) / baud >= 0.05
        assert 10 * (6 + 4 * words) / baud < 0.05
    port.baud = 1200
    with pytest.raises(InputError, match="at least 2001"):
        Uartbone(port)


def session(bone):
    board = Board(bone)
    board.write("sensor_pattern", 2)
    taken = capture.burst(board, 2, clear=True)
    return board.identifier(), board.info(), taken.planes.tolist(), prbs.check(board, 15, 9)[:-1]


def test_a_session_replays_from_its_log(make_port, tmp_path):
    """With a lost byte in it, which the replay recovers as the session did."""
    port = make_port(faults={("tx", 100): "drop"})
    with LineLog(tmp_path / "log", port) as log:
        live = session(Uartbone(port, log=log))
    lines = [json.loads(line) for line in (tmp_path / "log").read_text().splitlines()]
    assert all({"monotonic", "wall", "event"} <= line.keys() for line in lines)
    assert [line["fault"] for line in lines if line.get("fault")] == ["short"]
    replay = ReplayPort(tmp_path / "log")
    assert session(Uartbone(replay)) == live
    assert replay.finished


def test_a_replay_names_the_first_difference(make_port, tmp_path):
    port = make_port()
    with LineLog(tmp_path / "log", port) as log:
        Uartbone(port, log=log).read(0, 2)
    text = (
        f"line 2 of the replay of {tmp_path / 'log'}: the host sends 020100000001, the log "
        "contains a read of 2 words at 0x0 (020200000000)"
    )
    with pytest.raises(LineFault) as fault:
        Uartbone(ReplayPort(tmp_path / "log")).read(4)
    assert fault.value.cause is Cause.DIFFERS and fault.value.text == text
    bone = Uartbone(ReplayPort(tmp_path / "log"))
    bone.read(0, 2)
    with pytest.raises(LineFault, match="the end of the log"):
        bone.read(0, 2)


@given(st.data())
def test_any_log_is_replayed_or_refused(tmp_path_factory, data):
    head = '{"monotonic": 0, "wall": "", "event": "open", "format": "viform-line-1", "baud": 9600}'
    value = st.one_of(st.none(), st.integers(), st.text(max_size=4), st.just("0201"))
    names = ["event", "monotonic", "hex", "more", "wanted", "value", "command", "address", "words"]
    event = st.dictionaries(st.sampled_from(names), value).map(json.dumps)
    kind = st.sampled_from(["write", "read", "stray", "silence"])
    text = st.one_of(st.text(max_size=40), event, kind.map(lambda name: f'{{"event":"{name}"}}'))
    path = tmp_path_factory.getbasetemp() / "any-log"
    path.write_text(f"{head}\n{data.draw(text)}\n", encoding="utf-8", errors="replace")
    try:
        ReplayPort(path)
    except InputError as error:
        assert "\n" not in str(error)


@pytest.mark.parametrize("url", ["", " ", "socket://localhost", "socket://localhost:99999"])
def test_a_url_without_what_it_needs_is_refused_in_our_words(url):
    with pytest.raises(InputError, match=r"a port must be .*(nothing|its port is missing)"):
        open_port(url, 115_200)


def test_a_file_that_is_not_a_port_is_refused_as_such():
    with pytest.raises(LineFault, match="/dev/null exists but is not a serial port"):
        open_port("/dev/null", 115_200)


def test_a_system_without_terminals_imports_the_host_side():
    """Windows has none of these modules, and pyserial opens its ports without them."""
    program = (
        "import sys, psutil\n"
        "for name in ('termios', 'fcntl', 'grp', 'pwd', 'resource', 'tty', 'pty'):\n"
        "    sys.modules[name] = None\n"
        "import rtl_model.bringup.run, rtl_model.bringup.report.page, scenarios.cli.board.bringup\n"
    )
    ended = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert ended.returncode == 0, ended.stderr
