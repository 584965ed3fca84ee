"""The local server of `viform view` against other users of the machine, who can connect to it, and
against a stream that is replaced while it is shown."""

from __future__ import annotations

import os
import resource
import shutil
import socket
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from http.client import HTTPResponse
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cosim import Clock, Viform
from cosim.files.recorder import write_zarr
from cosim.spikes.viform import pack_planes
from scenarios.view import server as serving
from scenarios.view.opened import Opened, open_recording
from scenarios.view.server import CONNECTIONS, ViewServer

SHAPE = (4, 6)


def stream(level: float, cycles: int = 200) -> Viform:
    planes = np.random.default_rng(1).random((cycles, *SHAPE)) < level
    return Viform(pack_planes(planes), cycles, Clock(40_000))


@contextmanager
def served(made: ViewServer) -> Iterator[None]:
    thread = threading.Thread(target=made.serve_forever, args=(0.01,))
    thread.start()
    try:
        yield
    finally:
        made.shutdown()
        thread.join()


@pytest.fixture
def server() -> Iterator[ViewServer]:
    with ViewServer() as made:
        made.opened = Opened("A", stream(0.3), 0.6, 41, None, [])
        yield made


def connected(server: ViewServer) -> socket.socket:
    return socket.create_connection(("127.0.0.1", server.server_port), timeout=20)


def get(server: ViewServer, target: str) -> bytes:
    host = f"127.0.0.1:{server.server_port}"
    return f"GET {target} HTTP/1.1\r\nHost: {host}\r\n\r\n".encode()


def answer(line: socket.socket) -> bytes:
    """The head of an answer, b"" from a connection that was ended."""
    try:
        return line.recv(65_536)
    except ConnectionResetError:
        return b""


def status(line: socket.socket) -> int:
    """The status of the next answer, which is read whole: its head and its body come in as many
    pieces as the machine likes."""
    with HTTPResponse(line) as said:
        said.begin()
        said.read()
        return said.status


def told(server: ViewServer, given: bytes) -> bytes:
    """All that the server says to a client that sends something and no more."""
    with connected(server) as line:
        with suppress(OSError):  # it has refused, and reads no more
            line.sendall(given)
            line.shutdown(socket.SHUT_WR)
        parts = []
        while part := answer(line):
            parts.append(part)
    return b"".join(parts)


NUMBERS = (
    "--5",
    "5-",
    "-",
    "+5",
    "1e3",
    "0x5",
    "5.0",
    "",
    "9" * 5000,
    "%D9%A3",
    "%C2%B2",
    "1_0",
    "%00",
)


def test_garbage_is_refused_in_one_line(
    server: ViewServer, capfd: pytest.CaptureFixture[str]
) -> None:
    token, pixel = f"token={server.token}", "x=0&y=0"
    asked = ["http://[::1/", "//[", "http://[x]/"]
    for number in NUMBERS:
        asked += [f"/rates?{token}&method=tfp&window=1&at={number}",
                  f"/spikes?{token}&{pixel}&first={number}&stop=9",
                  f"/course?{token}&{pixel}&cycles={number}"]  # fmt: skip
    with served(server):
        for target in asked:
            head, _, line = told(server, get(server, target)).partition(b"\r\n\r\n")
            assert b"\n" not in line
            assert head.startswith(b"HTTP/1.1 40") or "/course" in target, target
    assert capfd.readouterr().err == ""


WORDS = st.sampled_from([
    b"GET", b"HEAD", b"POST", b"/", b"//[", b"http://[::1/", b"HTTP/1.1", b"HTTP/1.0", b"HTTP/9",
    b"HTTP/1.1.1", b" ", b"\r\n", b"\r\n\r\n", b"\n", b"Host: ", b"Origin: ", b":", b"\0",
    b"Expect: 100-continue", b"Content-Length: -1", b"Transfer-Encoding: chunked", b"\xff\xfe",
    b"X: y\r\n" * 200, b"%", b"?", b"&", b"at=", b"x=1;y=2", b"/rates?", b"/course?", b"cycles=",
    b"TOKEN", b"HOST", b"LONG",
])  # fmt: skip


@settings(max_examples=150)
@given(st.lists(WORDS | st.binary(max_size=20), max_size=12), st.sampled_from(["page", "data", ""]))
def bombard(server: ViewServer, words: list[bytes], about: str) -> None:
    token, host = server.token.encode(), f"127.0.0.1:{server.server_port}".encode()
    text = b"".join(words).replace(b"TOKEN", b"token=" + token).replace(b"HOST", host)
    text = text.replace(b"LONG", b"a" * 70_000)
    if about:
        target = b"/?token=" if about == "page" else b"/rates?at=1&token="
        text = b"GET " + target + token + text + b" HTTP/1.1\r\nHost: " + host + b"\r\n\r\n" + text
    said = told(server, text)
    assert b"Traceback" not in said


def test_no_request_harms_the_server(server: ViewServer, capfd: pytest.CaptureFixture[str]) -> None:
    with served(server):
        bombard(server)
        assert told(server, get(server, f"/?token={server.token}")).startswith(b"HTTP/1.1 200")
    assert capfd.readouterr().err == ""


def test_a_connection_without_a_request_ends(
    server: ViewServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(serving, "_FIRST_S", 0.3)
    with served(server), connected(server) as page, connected(server) as idle:
        page.sendall(get(server, f"/?token={server.token}"))
        assert status(page) == 200
        with connected(server) as slow, pytest.raises(ConnectionError):
            for byte in get(server, "/" + 1000 * "a"):  # one byte at a time has no other limit
                slow.sendall(bytes([byte]))
                time.sleep(0.02)
        assert answer(idle) == b""
        page.sendall(get(server, f"/rates?token={server.token}&at=1&method=tfp&window=1"))
        assert status(page) == 200  # the browser's waits longer


def test_many_connections_keep_nobody_out(server: ViewServer) -> None:
    """As many as three browsers have are answered at a time; strangers leave first."""
    with served(server), ExitStack() as stack, connected(server) as page:
        page.sendall(get(server, f"/?token={server.token}"))
        assert answer(page).startswith(b"HTTP/1.1 200")
        before = threading.active_count()
        strangers = [stack.enter_context(connected(server)) for _ in range(3 * CONNECTIONS)]
        assert told(server, get(server, "/")).startswith(b"HTTP/1.1 403")
        assert answer(strangers[0]) == b""
        assert threading.active_count() < before + CONNECTIONS + 8
        page.sendall(get(server, "/"))
        while b"HTTP/1.1 403" not in (said := answer(page)):
            assert said


def test_a_server_with_few_descriptors_lets_a_browser_in(
    server: ViewServer, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """Connections that wait are ended for it, and files of the page can still be opened. Those
    below are made before the limit."""
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    calls: list[int] = []
    accept = ViewServer.get_request

    def counted(self: ViewServer) -> Any:
        calls.append(1)
        return accept(self)

    monkeypatch.setattr(ViewServer, "get_request", counted)
    with ExitStack() as stack:
        strangers = [stack.enter_context(connected(server)) for _ in range(20)]
        page = stack.enter_context(connected(server))
        page.sendall(get(server, f"/?token={server.token}"))
        free = os.dup(strangers[0].fileno())
        os.close(free)
        resource.setrlimit(resource.RLIMIT_NOFILE, (free + 8, hard))
        stack.callback(resource.setrlimit, resource.RLIMIT_NOFILE, (soft, hard))
        stack.enter_context(served(server))
        assert answer(page).startswith(b"HTTP/1.1 200")
    assert len(calls) < 100  # no busy loop
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("kind", ["zarr", "dat", "removed"])
def test_a_stream_that_is_replaced_is_not_mixed(
    server: ViewServer, tmp_path: Path, kind: str
) -> None:
    """Chunks that were kept, and those of the new stream."""
    ending, size = (".dat", SHAPE[::-1]) if kind == "dat" else (".zarr", None)
    place, other = tmp_path / f"a{ending}", tmp_path / f"b{ending}"
    for path, level in ((place, 0.1), (other, 0.9)):
        if kind == "dat":
            planes = stream(level).planes()[:, ::-1].reshape(len(stream(level).planes()), -1)
            path.write_bytes(np.packbits(planes, axis=1, bitorder="little").tobytes())
        else:
            write_zarr(stream(level), path)
    server.opened = open_recording(place, size)
    asked = "/rates?method=tfp&window=1&at={}&token=" + server.token
    with served(server):
        assert told(server, get(server, asked.format(10))).startswith(b"HTTP/1.1 200")
        if kind == "dat":
            place.write_bytes(other.read_bytes())
        else:
            shutil.rmtree(place)
        if kind == "zarr":
            shutil.copytree(other, place)
        for target in (asked.format(10), asked.format(150), f"/?token={server.token}"):
            head, _, line = told(server, get(server, target)).partition(b"\r\n\r\n")
            assert head.startswith(b"HTTP/1.1 400"), target
            assert b"must be the stream that was opened" in line
            assert (b"removed" in line) == (kind == "removed")
