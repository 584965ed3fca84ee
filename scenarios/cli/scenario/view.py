"""`viform view`: explore the stream of a finished run in a browser."""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from cosim.compute.stopping import said
from cosim.errors import say
from scenarios.cli.output import Json, print_document, size_option, tell

if TYPE_CHECKING:
    from scenarios.view.server import ViewServer


def view(
    run: Annotated[Path, typer.Argument(help="folder of a run, or a stream of any format")],
    port: Annotated[int, typer.Option(min=0, max=65535, help="port; 0 for a free one")] = 0,
    size: Annotated[str | None, typer.Option(help="WxH of a stream without a header")] = None,
    json: Json = False,
) -> None:
    """Explore a stream in a browser: images at any cycle, the true light, the spikes of a pixel. It
    serves this machine alone, until Ctrl-C."""
    from cosim import InputError
    from cosim.run.loop import end_requests
    from scenarios.view.server import HOST, ViewServer

    pixels = size_option(size)
    try:
        server = ViewServer(port)
    except OSError as exc:
        raise InputError(
            "--port", f"a free port of {HOST}", f"{port} ({exc.strerror})", "leave it out"
        ) from None
    ended = end_requests()
    failed: list[BaseException] = []

    def open_stream() -> None:
        try:
            _open(server, run, pixels, json)
        except BaseException as exc:
            failed.append(exc)
            ended.set()

    with server, _serving(server):
        opening = threading.Thread(target=open_stream, daemon=True)  # Ctrl-C does not wait for it
        opening.start()
        ended.wait()
        if failed:
            raise failed[0]
        said()
        say("ended")


def _open(server: ViewServer, run: Path, size: tuple[int, int] | None, json: bool) -> None:
    """Gives the server its stream, and prints and opens its address."""
    from scenarios.view.opened import open_recording, with_scene

    opened = open_recording(run, size)
    if json:
        print_document({"stream": str(run), "address": server.address})
    else:
        tell(server.address)
        tell("open this address in a browser; Ctrl-C ends it")
    sys.stdout.flush()
    if _has_browser():
        import webbrowser

        webbrowser.open(server.invitation)
    server.opened = with_scene(opened, run)
    for note in server.opened.notes:
        say(note)


@contextmanager
def _serving(server: ViewServer) -> Iterator[None]:
    """The server answers within this context, in a thread."""
    thread = threading.Thread(target=server.serve_forever, kwargs={"poll_interval": 0.1})
    thread.start()
    try:
        yield
    finally:
        server.shutdown()
        thread.join()


def _has_browser() -> bool:
    """Whether a browser with a window of its own can be expected; one for terminals would take this
    terminal."""
    shown = any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER"))
    return shown or sys.platform in ("darwin", "win32")
