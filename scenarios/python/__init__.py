"""The Python interface: functions that do what the commands do, with arrays in and out.

The module `viform` exports them.
"""

from scenarios.python.camera import Camera
from scenarios.python.display import Display
from scenarios.python.filming import film
from scenarios.python.finished import Run
from scenarios.python.link import Link
from scenarios.python.runs import run, send, show
from scenarios.python.streams import Stream, open_stream, reconstruct, save_stream

__all__ = [
    "Camera", "Display", "Link", "Run", "Stream", "film", "open_stream", "reconstruct", "run",
    "save_stream", "send", "show",
]  # fmt: skip
