"""The local server of `viform view`: what it serves, and what it refuses."""

from __future__ import annotations

import http.client
import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit
from urllib.request import urlopen

import numpy as np
import pytest

from cosim import Clock, Viform
from cosim.files.recorder import write_zarr
from cosim.files.zarr_store import ZarrStream
from cosim.report.png import to_linear_bytes
from cosim.spikes.viform import pack_planes
from scenarios.view.opened import Opened, open_recording, with_scene
from scenarios.view.server import MOST, ViewServer
from sensor.reconstruct import reconstruct
from sensor.reconstruct.intervals import isi

CYCLES, SHAPE = 100, (6, 9)


def stream() -> Viform:
    planes = np.random.default_rng(3).random((CYCLES, *SHAPE)) < 0.3
    return Viform(pack_planes(planes), CYCLES, Clock(40_000))


class Scene:
    """Light that grows along rows and with time."""

    notes: list[str] = []  # noqa: RUF012

    def truth(self, ps: int) -> np.ndarray:
        x = np.arange(SHAPE[1], dtype=np.float32) / 10
        return np.broadcast_to(x, SHAPE) + np.float32(ps * 1e-12)

    def truth_at(self, ps: int, points: list[tuple[int, int, str]]) -> list[float]:
        return [float(self.truth(ps)[y, x]) for y, x, _ in points]


@pytest.fixture
def server() -> Iterator[ViewServer]:
    opened = Opened("A <title>", stream(), 0.6, 41, Scene(), [])  # type: ignore[arg-type]
    with ViewServer() as made:
        made.opened = opened
        thread = threading.Thread(target=made.serve_forever, args=(0.01,))
        thread.start()
        try:
            yield made
        finally:
            made.shutdown()
            thread.join()


def ask(server: ViewServer, path: str, **headers: str) -> tuple[int, bytes, Any]:
    connection = http.client.HTTPConnection("127.0.0.1", server.server_port, timeout=10)
    connection.request("GET", path, headers=headers)
    answer = connection.getresponse()
    content = answer.read()
    connection.close()
    return answer.status, content, answer.headers


def data(server: ViewServer, what: str, **values: Any) -> bytes:
    query = "&".join(f"{name}={value}" for name, value in values.items())
    status, content, _ = ask(server, f"/{what}?token={server.token}&{query}")
    assert status == 200, content
    return content


def test_the_page_needs_its_token(server: ViewServer) -> None:
    parts = urlsplit(server.address)
    status, page, headers = ask(server, f"/?{parts.query}")
    assert status == 200 and b"A &lt;title&gt;" in page and b"explorer" in page
    assert "default-src 'none'" in headers["Content-Security-Policy"]
    assert parts.hostname == "127.0.0.1"
    for path in ("/", "/?token=", "/?token=wrong", f"/rates?at=3&token={server.token[:-1]}"):
        status, line, _ = ask(server, path)
        assert status == 403 and line.count(b"\n") == 0 and b"token" in line


def test_an_invitation_leads_to_the_page_once(server: ViewServer) -> None:
    """Every user of the machine can read the command line of the browser, where it stands."""
    invitation = urlsplit(server.invitation)
    assert server.token not in server.invitation
    status, content, headers = ask(server, f"/?{invitation.query}")
    assert status == 303 and content == b""
    assert headers["Location"] == f"/?{urlsplit(server.address).query}"
    for query in (invitation.query, "once=", "once=wrong"):
        assert ask(server, f"/?{query}")[0] == 403


def test_a_file_need_not_have_a_name_in_utf_8(server: ViewServer) -> None:
    assert server.opened is not None
    server.opened.title = os.fsdecode(b"a\xff")
    status, page, _ = ask(server, f"/?token={server.token}")
    assert status == 200 and rb"<h1>a\udcff</h1>" in page


def test_other_hosts_and_origins_are_refused(server: ViewServer) -> None:
    path = f"/?token={server.token}"
    port = server.server_port
    for host in ("evil.example", "127.0.0.1", f"evil.example:{port}", f"127.0.0.1:{port + 1}"):
        assert ask(server, path, Host=host)[0] == 403
    for origin in ("http://evil.example", "null", f"https://127.0.0.1:{port}", ""):
        assert ask(server, path, Origin=origin)[0] == 403
    assert ask(server, path, Host=f"localhost:{port}", Origin=f"http://localhost:{port}")[0] == 200


@pytest.mark.parametrize(
    "path", ["/result.json", "/../etc/passwd", "/stream.zarr/zarr.json", "/rates/x", "/Rates"]
)
def test_nothing_else_is_served(server: ViewServer, path: str) -> None:
    assert ask(server, f"{path}?token={server.token}&at=1")[0] == 404


def test_images_are_those_of_the_program(server: ViewServer) -> None:
    given = stream()
    for at in (0, 50, CYCLES - 1):
        for window in (1, 41):
            got = np.frombuffer(data(server, "rates", at=at, method="tfp", window=window), "<f4")
            assert (got.reshape(SHAPE) == reconstruct(given, "tfp", at, window).rate).all()
        got = np.frombuffer(data(server, "rates", at=at, method="tfi", window=41), "<f4")
        assert (got.reshape(SHAPE) == reconstruct(given, "tfi", at).rate).all()
        got = np.frombuffer(data(server, "rates", at=at, method="tau", window=41), "<f4")
        assert (got.reshape(SHAPE) == isi(given, at)).all()


def test_spikes_and_light_of_a_pixel(server: ViewServer) -> None:
    planes = stream().planes()
    found = json.loads(data(server, "spikes", x=7, y=2, first=10, stop=90))
    assert found == (np.flatnonzero(planes[10:90, 2, 7]) + 10).tolist()
    light = np.frombuffer(data(server, "light", at=5), np.uint8).reshape(SHAPE)
    assert (light == to_linear_bytes(Scene().truth(Clock(40_000).middle(5)))).all()
    course = json.loads(data(server, "course", x=3, y=1, cycles="0+99"))
    middles = [Clock(40_000).middle(cycle) * 1e-12 for cycle in (0, 99)]
    assert course == pytest.approx([0.3 + s for s in middles])


@pytest.mark.parametrize(
    "query",
    [
        "rates?at=100&method=tfp&window=41",
        "rates?at=-1&method=tfp&window=41",
        "rates?at=1&method=tfp&window=0",
        "rates?at=1&method=tfp&window=40",
        "rates?at=1&method=best&window=41",
        "rates?at=1e9&method=tfp&window=41",
        "rates?at=1",
        "rates?at=%00&method=tfp&window=41",
        "spikes?x=9&y=0&first=0&stop=10",
        "spikes?x=0&y=6&first=0&stop=10",
        f"spikes?x=0&y=0&first=0&stop={MOST + 1}",
        "spikes?x=0&y=0&first=9&stop=3",
        "light?at=100",
        "course?x=0&y=0&cycles=1+x",
        "course?x=0&y=0&cycles=" + "1+" * (MOST + 1),
    ],
)
def test_bad_parameters_are_refused_in_one_line(server: ViewServer, query: str) -> None:
    what, _, rest = query.partition("?")
    status, line, _ = ask(server, f"/{what}?token={server.token}&{rest}")
    assert status == 400 and line and b"\n" not in line and b"Traceback" not in line
    assert data(server, "rates", at=1, method="tfp", window=1)  # it goes on


@pytest.mark.parametrize("error", [ConnectionResetError, TimeoutError, KeyError])
def test_a_browser_that_leaves_says_nothing(
    server: ViewServer, error: type[Exception], capsys: pytest.CaptureFixture[str]
) -> None:
    try:
        raise error("here")
    except Exception:
        server.handle_error(None, ("127.0.0.1", 1))
    assert ("Traceback" in capsys.readouterr().err) == (error is KeyError)


def test_a_stream_without_a_run_has_no_light(tmp_path: Path) -> None:
    write_zarr(stream(), tmp_path / "a.zarr")
    opened = with_scene(open_recording(tmp_path / "a.zarr"), tmp_path / "a.zarr")
    assert opened.source is None and opened.white == 1.0 and opened.window == 41
    chip = 1 << 23  # bytes of a chunk of 1000 x 1000 pixels; intervals of dim ones take a dozen
    assert isinstance(opened.stream, ZarrStream) and opened.stream.kept > 24 * chip
    assert opened.course(0, 0, [1]) is None


def test_a_page_waits_until_the_stream_is_open() -> None:
    """The server answers before it has a stream: its page loads itself again, data say 503."""
    with ViewServer() as made:
        thread = threading.Thread(target=made.serve_forever, args=(0.01,))
        thread.start()
        try:
            status, page, _ = ask(made, f"/?token={made.token}")
            assert status == 200 and b'http-equiv="refresh"' in page and b"explorer" not in page
            assert ask(made, "/?token=wrong")[0] == 403
            assert ask(made, f"/rates?token={made.token}&at=1&method=tfp&window=1")[0] == 503
            made.opened = Opened("A", stream(), 0.6, 41, None, [])
            assert b"data-kind='stream'" in ask(made, f"/?token={made.token}")[1]
        finally:
            made.shutdown()
            thread.join()


def view(*words: str) -> subprocess.Popen[str]:
    """`viform view` in a process of its own, without a browser."""
    hidden = ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER")
    env = {name: value for name, value in os.environ.items() if name not in hidden}
    code = "from scenarios.cli.entry import main; main()"
    return subprocess.Popen(
        [sys.executable, "-c", code, "view", *words],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=env,
    )  # fmt: skip


def test_the_command_serves_until_it_is_ended(tmp_path: Path) -> None:
    write_zarr(stream(), tmp_path / "a.zarr")
    process = view(str(tmp_path / "a.zarr"))
    assert process.stdout is not None
    address, hint = (process.stdout.readline().strip() for _ in range(2))
    assert hint == "open this address in a browser; Ctrl-C ends it"
    while b"data-kind='stream'" not in (page := urlopen(address).read()):
        assert b"refresh" in page
    for _ in range(3):  # a user who is in a hurry
        process.send_signal(signal.SIGINT)
        time.sleep(0.03)
    said, errors = process.communicate(timeout=60)
    assert (said, errors) == ("", "viform: ended\n")
    assert process.returncode in (0, -signal.SIGINT)  # the last one may come after its end


@pytest.mark.parametrize("wrong", ["absent", "empty", "port"])
def test_wrong_inputs_of_the_command_are_one_line(tmp_path: Path, wrong: str) -> None:
    words, part = [str(tmp_path / wrong)], str(tmp_path)
    (tmp_path / "empty").mkdir()
    with socket.socket() as taken:
        if wrong == "port":
            write_zarr(stream(), tmp_path / "a.zarr")
            taken.bind(("127.0.0.1", 0))
            taken.listen()
            part = str(taken.getsockname()[1])
            words = [str(tmp_path / "a.zarr"), "--port", part]
        process = view(*words)
        said, errors = process.communicate(timeout=60)
    assert process.returncode == 2 and said == ""
    assert errors.count("\n") == 1 and part in errors and "must be" in errors
