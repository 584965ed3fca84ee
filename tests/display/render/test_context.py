"""Every way in which GL is missing, old or lost is one line; in child processes, for real."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import moderngl
import numpy as np
import pytest

import display.render.context
from cosim import Clock, InputError
from display import GL_INSTALL, SpikePanel, probe_gl
from display.render.renderer import Renderer

OPEN = """
from cosim import InputError
from display.render.context import open_context
try:
    open_context()
    print("opened")
except InputError as exc:
    print(exc)
"""


def said(**environment: str) -> str:
    """What a process says that opens a context under these environment variables."""
    child = subprocess.run(
        [sys.executable, "-c", OPEN], capture_output=True, text=True, timeout=100,
        env={**os.environ, **environment}, cwd=Path(__file__).parents[2],
    )  # fmt: skip
    assert child.returncode == 0 and "Traceback" not in child.stderr, child.stderr
    return child.stdout.strip()


@pytest.mark.usefixtures("gl")
@pytest.mark.parametrize(
    ("environment", "begins"),
    [
        ({"__EGL_VENDOR_LIBRARY_DIRS": "/nonexistent"}, "the EGL vendor must be installed"),
        ({"LIBGL_DRIVERS_PATH": "/nonexistent"}, "the GL driver must be one that starts"),
        ({"MESA_GL_VERSION_OVERRIDE": "3.2"}, "OpenGL must be version 3.3 or later"),
    ],
)
def test_a_machine_without_gl_gets_one_line_with_the_mend(
    environment: dict[str, str], begins: str
) -> None:
    if "llvmpipe" not in probe_gl()[1]:
        pytest.skip("needs Mesa's llvmpipe (libgl1-mesa-dri), whose parts can be hidden")
    line = said(**environment)
    assert line.startswith(begins) and "\n" not in line
    assert GL_INSTALL in line and "display.renderer=numpy" in line


def test_a_machine_without_the_libraries_gets_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    backend = {**display.render.context._BACKEND, "libegl": "libEGL-of-nobody.so.1"}
    monkeypatch.setattr(display.render.context, "_BACKEND", backend)
    with pytest.raises(InputError, match=r"libEGL\.so\.1, not missing \(libEGL-of-nobody"):
        display.render.context.open_context()


@pytest.mark.parametrize(
    ("key", "least"), [("GL_MAX_DRAW_BUFFERS", 8), ("GL_MAX_TEXTURE_SIZE", 1024)]
)
def test_too_little_of_a_driver_is_one_line(key: str, least: int) -> None:
    info = {
        "GL_RENDERER": "a driver", "GL_MAX_DRAW_BUFFERS": 8, "GL_MAX_TEXTURE_IMAGE_UNITS": 16,
        "GL_MAX_TEXTURE_SIZE": 1024,
    }  # fmt: skip
    display.render.context._check_limits(info)
    with pytest.raises(InputError, match=f"at least {least}, not {least - 1} .a driver"):
        display.render.context._check_limits({**info, key: least - 1})


def small() -> Renderer:
    return Renderer(SpikePanel((4, 4), Clock.from_hz(40e3), 0.5, "hold"), 8, 0)


@pytest.mark.usefixtures("gl")
def test_a_closed_context_is_one_line_from_every_method() -> None:
    renderer = small()
    words = np.zeros((1, 4, 4), np.uint32)
    renderer.step(words, 32, None)
    state = renderer.state()
    renderer.close()
    calls: list[Any] = [
        lambda: renderer.step(words, 32, None), renderer.state, lambda: renderer.restore(state),
        lambda: renderer.take(0), lambda: renderer.light,
    ]  # fmt: skip
    for call in calls:
        with pytest.raises(InputError, match=r"lost during the run.*--resume"):
            call()


@pytest.mark.usefixtures("gl")
def test_an_error_of_the_driver_is_one_line_and_so_is_its_memory(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    renderer = small()
    words = np.zeros((1, 4, 4), np.uint32)
    with pytest.raises(moderngl.Error):
        renderer._context.buffer(reserve=0)
    renderer.step(words, 32, None)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(moderngl.Context, "error", property(lambda self: "GL_CONTEXT_LOST"))
        with pytest.raises(InputError, match=r"lost during the run .GL_CONTEXT_LOST"):
            renderer.step(words, 32, None)
    monkeypatch.setattr(moderngl.Context, "error", property(lambda self: "GL_OUT_OF_MEMORY"))
    with pytest.raises(InputError, match="the panel must be small enough for the memory"):
        renderer.step(words, 32, None)
    renderer.close()


@pytest.mark.usefixtures("gl")
def test_a_panel_beyond_the_texture_limit_or_the_memory_is_one_line() -> None:
    context = display.render.context.open_context()
    tall = context.info["GL_MAX_TEXTURE_SIZE"] + 1
    context.release()
    with pytest.raises(InputError, match=rf"the panel must be .*, not 1 x {tall}; make it smaller"):
        Renderer(SpikePanel((tall, 1), Clock.from_hz(40e3), 0.5), 8, 0)
    with pytest.raises(InputError, match="the panel must be small enough for the"):
        Renderer(SpikePanel((10**6, 10**6), Clock.from_hz(40e3), 0.5), 8, 1)


def test_the_probe_names_the_renderer_or_the_reason(
    monkeypatch: pytest.MonkeyPatch, gl: str
) -> None:
    assert probe_gl() == (True, gl)
    monkeypatch.setattr(display.render.context, "_PROBE", "import os; os.abort()")
    there, said = probe_gl()
    assert not there and said == "the GL driver ended its process (-6)"
