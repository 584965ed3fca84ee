"""The local server of `viform view`: the explorer over a stream at full resolution.

It listens on 127.0.0.1 alone. Every request must carry the token of the address that the command
prints, and the names of this machine as host and origin, so that no other page in a browser, and no
name that was redirected here, can read the stream. It serves the page and the data of the
explorer, and no files.

Other users of the machine can connect, though they learn nothing. So a connection has a time limit
for its request, and their number a limit as well: a new one ends the one that has waited longest,
first among those that have not shown the token.
"""

from __future__ import annotations

import hmac
import html
import json
import math
import os
import re
import resource
import secrets
import socket
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from threading import Lock
from typing import TYPE_CHECKING, Any, Final
from urllib.parse import parse_qs, urlsplit

from cosim.errors import ViformError

if TYPE_CHECKING:
    from scenarios.view.opened import Opened

HOST: Final = "127.0.0.1"
MOST: Final = 4096
"""Cycles of a pixel in one answer, at most."""
CONNECTIONS: Final = 32
"""Connections at a time, at most. A browser opens six."""
_FILES: Final = 16
"""Descriptors that connections leave for the files of the stream and of the page."""
_FIRST_S: Final = 5.0
"""Time limit of the first request of a connection, s."""
_NEXT_S: Final = 60.0
"""Time limit of the next request of one that has shown the token, s, and of an answer until it is
taken."""
_WHOLE: Final = re.compile(r"-?[0-9]{1,11}", re.ASCII)
_POLICY: Final = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
    "connect-src 'self'; img-src blob: data:"
)
"""Content-Security-Policy: the page talks to this server alone."""
_WAIT: Final = (
    '<!doctype html><html lang="en"><head><meta charset="utf-8"><title>Viform</title>'
    '<meta http-equiv="refresh" content="1"><meta name="color-scheme" content="light dark">'
    "<style>body { font: 16px system-ui, sans-serif; margin: 40px; }</style></head>"
    '<body><p role="status">The stream is being opened; this page then shows it.</p></body></html>'
)
_METHODS: Final = ("tfp", "tfi", "tau")


class _Moved(Exception):
    """What is asked for stands at another address, which is the text."""


class _Refused(Exception):
    """A request that is not answered: status and one line."""

    def __init__(self, status: int, line: str) -> None:
        super().__init__(line)
        self.status = status


class _Query:
    """The parameters of a request."""

    def __init__(self, text: str) -> None:
        self._values = parse_qs(text)

    def text(self, name: str) -> str:
        return self._values.get(name, [""])[0]

    def whole(self, name: str, least: int, most: int) -> int:
        """A whole number between two limits, or a refusal."""
        text = self.text(name)
        number = int(text) if _WHOLE.fullmatch(text) else None
        if number is None or not least <= number <= most:
            raise _Refused(400, f"{name} must be a whole number from {least} to {most}")
        return number


@dataclass(eq=False)
class _Connection:
    """A connection to the server.

    Attributes:
        until: instant at which its request must have come (time.monotonic()); infinite while it is
            answered.
        known: whether it has shown the token.
        ended: whether the server has ended it.
    """

    until: float
    known: bool = False
    ended: bool = False


class ViewServer(ThreadingHTTPServer):
    """Serves a stream until it is shut down. It listens from the start, before the stream is known.

    Args:
        port: port, or 0 for a free one. Raises OSError if it is taken.

    Attributes:
        address: address of the page, with the token.
        invitation: address that leads to the page once, for the command line of a browser, which
            every user of the machine can read.
        opened: the stream; until it is set, the page says that it is being opened.
    """

    daemon_threads = True
    request_queue_size = 2 * CONNECTIONS

    def __init__(self, port: int = 0) -> None:
        super().__init__((HOST, port), _Handler)
        self.opened: Opened | None = None
        self._connections: dict[socket.socket, _Connection] = {}
        self._connecting = Lock()
        self.token, self.lock = secrets.token_urlsafe(24), Lock()
        self.names = {f"{name}:{self.server_port}" for name in (HOST, "localhost")}
        self.address = f"http://{HOST}:{self.server_port}/?token={self.token}"
        self._once: str | None = secrets.token_urlsafe(24)
        self.invitation = f"http://{HOST}:{self.server_port}/?once={self._once}"

    def page(self) -> bytes:
        """The page of the explorer, or one that waits for it and then loads it."""
        from cosim.report.explorer import explorer
        from cosim.report.page import whole_page

        opened = self.opened
        if opened is None:
            return _WAIT.encode()
        height, width = opened.stream.shape
        whole = {
            "name": "whole chip", "x": 0, "y": 0, "step": 1, "width": width, "height": height,
            "truth": opened.source is not None,
        }  # fmt: skip
        cycles = opened.stream.cycles
        given: dict[str, Any] = {
            "hz": opened.stream.clock.hz, "first": 0, "stop": cycles, "at": cycles // 2,
            "white": opened.white, "window": opened.window, "views": [whole], "token": self.token,
            "note": " ".join(opened.notes),
        }  # fmt: skip
        sections = f"<h2>Images and spikes</h2>{explorer(given)}"
        head = f"<h1>{html.escape(opened.title)}</h1>"
        page = whole_page(opened.title, head, sections, policy=_POLICY)
        return page.encode(errors="backslashreplace")  # the name of a file need not be UTF-8

    def handle_error(self, request: Any, client_address: Any) -> None:
        """Passes over a browser that has ended its connection, as it does while a user scrolls, or
        that does not take its answer."""
        if not isinstance(sys.exception(), (ConnectionError, TimeoutError)):
            super().handle_error(request, client_address)

    def get_request(self) -> tuple[socket.socket, Any]:
        """Accepts a connection. Without a descriptor for it, another one is ended."""
        try:
            return super().get_request()
        except OSError:
            self._end_one()
            time.sleep(0.05)  # until it is closed; this is tried again at once
            raise

    def process_request(self, request: Any, client_address: Any) -> None:
        """Answers a connection in a thread of its own. It takes the place of another one if there
        are as many as there may be; if all are being answered, it is closed."""
        with self._connecting:
            there = sum(not each.ended for each in self._connections.values())
        if (there >= CONNECTIONS or (there and _descriptors() < _FILES)) and not self._end_one():
            self.shutdown_request(request)
            return
        with self._connecting:
            self._connections[request] = _Connection(time.monotonic() + _FIRST_S)
        try:
            super().process_request(request, client_address)
        except RuntimeError:  # the system gives no thread
            self.shutdown_request(request)

    def shutdown_request(self, request: Any) -> None:
        """Closes a connection."""
        with self._connecting:
            self._connections.pop(request, None)
        super().shutdown_request(request)

    def service_actions(self) -> None:
        """Ends the connections whose time is over. It is called several times a second."""
        now = time.monotonic()
        with self._connecting:
            for request, each in self._connections.items():
                if each.until < now:
                    _end(request, each)

    def _end_one(self) -> bool:
        """Ends the connection that has waited longest, first of those that have not shown the
        token; returns whether one waits."""
        with self._connecting:
            waiting = [
                (each.known, each.until, n, request, each)
                for n, (request, each) in enumerate(self._connections.items())
                if not each.ended and each.until < math.inf
            ]
            if waiting:
                *_, request, each = min(waiting)
                _end(request, each)
        return bool(waiting)

    def invited(self, word: str) -> bool:
        """Whether this is the word of the invitation, which holds once."""
        with self._connecting:
            right = self._once is not None and hmac.compare_digest(
                word.encode(), self._once.encode()
            )
            if right:
                self._once = None
        return right

    def answering(self, request: socket.socket) -> None:
        """Takes the time limit off a connection whose request has come."""
        with self._connecting:
            self._connections[request].until = math.inf

    def waiting(self, request: socket.socket) -> None:
        """Begins the time limit of the next request of a connection that has been answered."""
        with self._connecting:
            each = self._connections[request]
            each.until = time.monotonic() + (_NEXT_S if each.known else _FIRST_S)

    def know(self, request: socket.socket) -> None:
        """Notes that a connection has shown the token."""
        with self._connecting:
            self._connections[request].known = True


def _descriptors() -> float:
    """Descriptors that are free."""
    limit, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    if limit == resource.RLIM_INFINITY:
        return math.inf
    try:
        return limit - len(os.listdir("/proc/self/fd"))
    except OSError:  # no Linux, or there is none for it
        return 0 if sys.platform == "linux" else math.inf


def _end(request: socket.socket, connection: _Connection) -> None:
    """Ends a connection; the thread that reads it closes it."""
    connection.ended = True
    with suppress(OSError):
        request.shutdown(socket.SHUT_RDWR)


class _Handler(BaseHTTPRequestHandler):
    server: ViewServer
    protocol_version = "HTTP/1.1"
    server_version, sys_version = "Viform", ""
    timeout = _NEXT_S

    def do_GET(self) -> None:
        self.server.answering(self.connection)
        moved: list[tuple[str, str]] = []
        try:
            kind, content = self._answer()
            status = 200
        except _Moved as exc:
            kind, content, status = "text/plain; charset=utf-8", b"", 303
            moved = [("Location", str(exc))]
        except _Refused as exc:
            kind, content, status = "text/plain; charset=utf-8", str(exc).encode(), exc.status
        except ViformError as exc:
            kind, content, status = "text/plain; charset=utf-8", str(exc).encode(), 400
        except OSError as exc:  # of the stream or the page: nothing has been sent yet
            line = f"the files must be readable, not refused ({exc.strerror}); ask again"
            kind, content, status = "text/plain; charset=utf-8", line.encode(), 503
        self.send_response(status)
        for name, value in (
            ("Content-Type", kind), ("Content-Length", str(len(content))),
            ("Content-Security-Policy", _POLICY), ("Cache-Control", "no-store"),
            ("Referrer-Policy", "no-referrer"), ("X-Content-Type-Options", "nosniff"), *moved,
        ):  # fmt: skip
            self.send_header(name, value)
        self.end_headers()
        self.wfile.write(content)
        self.server.waiting(self.connection)

    def log_message(self, format: str, *args: Any) -> None:
        """No line for each request."""

    def _answer(self) -> tuple[str, bytes]:
        """MIME type and content, or a refusal."""
        server = self.server
        try:
            asked = urlsplit(self.path)
        except ValueError:
            raise _Refused(400, "the address must be that of the page or of its data") from None
        query, origin = _Query(asked.query), self.headers.get("Origin")
        if self.headers.get("Host") not in server.names:
            raise _Refused(403, f"the host must be {HOST}")
        if origin is not None and origin.removeprefix("http://") not in server.names:
            raise _Refused(403, "the request must come from this page")
        if asked.path == "/" and server.invited(query.text("once")):
            raise _Moved(f"/?token={server.token}")
        if not hmac.compare_digest(query.text("token").encode(), server.token.encode()):
            raise _Refused(403, "the token must be that of the address that viform view printed")
        server.know(self.connection)
        if asked.path == "/":
            if server.opened is not None:
                server.opened.check()
            return "text/html; charset=utf-8", server.page()
        answers: dict[str, Callable[[_Query], tuple[str, bytes]]] = {
            "/rates": self._rates, "/spikes": self._spikes, "/light": self._light,
            "/course": self._course,
        }  # fmt: skip
        if asked.path not in answers:
            raise _Refused(404, "only the page and its data are served")
        if server.opened is None:
            raise _Refused(503, "the stream is being opened; ask again")
        with server.lock:  # decoding and images use all cores by themselves
            server.opened.check()
            answer = answers[asked.path](query)
            server.opened.check()
            return answer

    @property
    def _opened(self) -> Opened:
        assert self.server.opened is not None
        return self.server.opened

    def _cycle(self, query: _Query, name: str = "at") -> int:
        return query.whole(name, 0, self._opened.stream.cycles - 1)

    def _pixel(self, query: _Query) -> tuple[int, int]:
        height, width = self._opened.stream.shape
        return query.whole("x", 0, width - 1), query.whole("y", 0, height - 1)

    def _rates(self, query: _Query) -> tuple[str, bytes]:
        method = query.text("method")
        if method not in _METHODS:
            raise _Refused(400, f"method must be one of {', '.join(_METHODS)}")
        window = query.whole("window", 1, 100_001)
        rates = self._opened.rates(self._cycle(query), method, window)
        return "application/octet-stream", rates.astype("<f4").tobytes()

    def _spikes(self, query: _Query) -> tuple[str, bytes]:
        x, y = self._pixel(query)
        first = self._cycle(query, "first")
        stop = query.whole("stop", first, first + MOST)
        return _json(self._opened.spikes(x, y, first, stop))

    def _light(self, query: _Query) -> tuple[str, bytes]:
        from cosim.report.png import to_linear_bytes

        if self._opened.source is None:
            raise _Refused(404, "the true light is not known")
        shown = to_linear_bytes(self._opened.light(self._cycle(query)))
        return "application/octet-stream", shown.tobytes()

    def _course(self, query: _Query) -> tuple[str, bytes]:
        x, y = self._pixel(query)
        texts = query.text("cycles").split()
        last = self._opened.stream.cycles - 1
        if len(texts) > MOST or not all(t.isdecimal() and len(t) < 12 for t in texts):
            raise _Refused(400, f"cycles must be at most {MOST} whole numbers")
        return _json(self._opened.course(x, y, [min(int(t), last) for t in texts]))


def _json(value: Any) -> tuple[str, bytes]:
    return "application/json", json.dumps(value).encode()
