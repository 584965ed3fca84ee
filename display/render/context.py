"""The one place where a GL context is made: headless, through EGL, GL 3.3 or later.

Every way in which that fails ends in one line. `probe` looks from a child process, because a
driver may abort.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from typing import Any

import moderngl

from cosim import InputError
from cosim.errors import MissingPackages

__all__ = [
    "DRAW_BUFFERS", "GL_INSTALL", "check_alive", "gl_packages", "lost", "open_context", "probe_gl",
]  # fmt: skip

_DEBIAN = ("libegl1", "libegl-mesa0", "libgl1", "libgl1-mesa-dri")
"""Debian's packages that make a headless GL of the processor."""
GL_INSTALL = f"apt-get install -y {' '.join(_DEBIAN)}"
GL = 330
"""Least version: integer textures and outputs, explicit locations, bits of floats."""
DRAW_BUFFERS = 8
"""Targets of one draw, GL 3.3's least. The state takes up to four of them."""
UNITS = 8
"""Textures that a fragment reads: four of words, four of state."""
_BACKEND: dict[str, Any] = {"backend": "egl", "libgl": "libGL.so.1", "libegl": "libEGL.so.1"}
"""The default backend wants a window system, the default names those of -dev packages."""
INSTEAD = "or --set display.renderer=numpy, slower"
_PACKAGES = f"install a driver ({GL_INSTALL}), {INSTEAD}"
_CAUSES = (
    ("not loaded", "the GL libraries", "libGL.so.1 and libEGL.so.1", "missing"),
    ("found 0 devices", "the EGL vendor", "installed (libegl-mesa0)", "missing"),
    ("eglinitialize failed", "the GL driver", "one that starts (libgl1-mesa-dri)", "missing"),
    ("eglcreatecontext failed", "OpenGL", "version 3.3 or later", "older"),
    ("version", "OpenGL", "version 3.3 or later", "older"),
)
"""Of a failure's text in small letters: what is at fault, what it must be, and what it is."""
_PROBE = """
import json
from display.render.context import open_context
from cosim import InputError
try:
    gl = open_context()
    found = {"ok": True, "renderer": gl.info["GL_RENDERER"], "version": gl.info["GL_VERSION"]}
except InputError as exc:
    found = {"ok": False, "renderer": str(exc), "version": ""}
print(json.dumps(found))
"""


def open_context() -> moderngl.Context:
    """A context of its own, without a window. It belongs to the thread that makes it, and it does
    not outlive a fork.

    Raises InputError: no GL or EGL library, no EGL vendor, no driver, GL below 3.3, limits below
    what the shaders need.
    """
    # Mesa says on standard error what the one line below says better.
    os.environ.setdefault("EGL_LOG_LEVEL", "fatal")
    try:
        context = moderngl.create_context(require=GL, standalone=True, **_BACKEND)
    except Exception as exc:  # glcontext raises bare Exception
        raise _refused(exc) from None
    try:
        _check_limits(context.info)
    except InputError:
        context.release()
        raise
    return context


def gl_packages() -> tuple[str, ...]:
    """Debian's packages that bring a headless GL; none where the user has pointed the loader at
    drivers in other places."""
    loader = ("__EGL_VENDOR_LIBRARY_FILENAMES", "__EGL_VENDOR_LIBRARY_DIRS")
    return () if any(os.environ.get(name) for name in loader) else _DEBIAN


def _refused(exc: Exception) -> InputError:
    text = " ".join(str(exc).split())
    for words, what, must, given in _CAUSES:
        if words in text.lower():
            packages = gl_packages() if given == "missing" else ()
            return MissingPackages(what, must, f"{given} ({text})", _PACKAGES, packages)
    return InputError("the GL context", "one that can be made", f"refused ({text})", _PACKAGES)


def _check_limits(info: dict[str, Any]) -> None:
    for key, least, what in (
        ("GL_MAX_DRAW_BUFFERS", DRAW_BUFFERS, "draw buffers"),
        ("GL_MAX_TEXTURE_IMAGE_UNITS", UNITS, "textures a shader"),
        ("GL_MAX_TEXTURE_SIZE", 1024, "texels a side of a texture"),
    ):
        if info[key] < least:
            name = info["GL_RENDERER"]
            raise InputError(
                f"{what} of the GL driver", f"at least {least}", f"{info[key]} ({name})", _PACKAGES
            )


def lost(why: str) -> InputError:
    """What to raise when a context has stopped to work."""
    return InputError(
        "the GL context", "kept by its driver until the end", f"lost on the way ({why})",
        "run it again, with --resume where the run has a checkpoint, " + INSTEAD,
    )  # fmt: skip


def check_alive(context: moderngl.Context) -> None:
    """Raises InputError where a context was lost or released, or ran out of memory."""
    if type(context.mglo).__name__ == "InvalidObject":
        raise lost("released")
    with context:
        error = context.error
    if error == "GL_OUT_OF_MEMORY":
        raise InputError(
            "the panel", "small enough for the memory of the GL driver", "larger",
            f"make it smaller (display.width, display.height), {INSTEAD}",
        )  # fmt: skip
    if error != "GL_NO_ERROR":
        raise lost(error)


def probe_gl() -> tuple[bool, str]:
    """Whether a context can be made, and the renderer with its GL version, or the error's line."""
    try:
        child = subprocess.run(
            [sys.executable, "-c", _PROBE], capture_output=True, text=True, timeout=60
        )
        found = json.loads(child.stdout.strip().splitlines()[-1])
    except subprocess.TimeoutExpired:
        return False, "the GL driver did not answer within a minute"
    except (json.JSONDecodeError, IndexError):
        return False, f"the GL driver ended its process ({child.returncode})"
    return found["ok"], " ".join(filter(None, (found["renderer"], found["version"])))
