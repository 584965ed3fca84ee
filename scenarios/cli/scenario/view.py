"""`viform view`: explore the stream of a finished run in a browser."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Annotated

import typer

from scenarios.cli.output import Json, print_document, size_option

__all__ = ["view"]


def view(
    run: Annotated[Path, typer.Argument(help="folder of a run, or a stream of any format")],
    port: Annotated[int, typer.Option(min=0, max=65535, help="port; 0 for a free one")] = 0,
    size: Annotated[str | None, typer.Option(help="WxH of a stream without a header")] = None,
    json: Json = False,
) -> None:
    """Explore a stream in a browser: images at any cycle, the true light, the spikes of a pixel. It
    serves this machine alone, until Ctrl-C."""
    from cosim import InputError
    from scenarios.view.opened import open_run
    from scenarios.view.server import HOST, ViewServer

    opened = open_run(run, size_option(size))
    for note in opened.notes:
        print(f"viform: {note}", file=sys.stderr)
    try:
        server = ViewServer(opened, port)
    except OSError as exc:
        raise InputError(
            "--port", f"a free port of {HOST}", f"{port} ({exc.strerror})", "leave it out"
        ) from None
    with server:
        if json:
            print_document({"stream": str(run), "address": server.address})
        else:
            print(f"{server.address}\nCtrl-C ends it")
        sys.stdout.flush()
        if _has_browser():
            import webbrowser

            webbrowser.open(server.address)
        try:
            server.serve_forever(poll_interval=0.2)
        except KeyboardInterrupt:
            print("viform: ended", file=sys.stderr)


def _has_browser() -> bool:
    """Whether a browser with a window of its own can be expected; one for terminals would take this
    terminal."""
    shown = any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER"))
    return shown or sys.platform in ("darwin", "win32")
