"""Creates GL contexts: headless, by EGL, with GL 3.3 or later. No other file creates one.

Every failure is reported in one line. `probe_gl` uses a child process, because a driver may abort.
"""

from __future__ import annotations

import json
import os
import subprocess
from typing import Any

import moderngl

from cosim import InputError
from cosim.compute.forks import python_child, use
from cosim.errors import MissingPackages

_DEBIAN = ("libegl1", "libegl-mesa0", "libgl1", "libgl1-mesa-dri")
"""Debian packages of a headless GL on the processor."""
GL_INSTALL = f"apt-get install -y {' '.join(_DEBIAN)}"
GL = 330
"""Minimum version: integer textures and outputs, explicit locations, float-to-bits functions."""
DRAW_BUFFERS = 8
"""Maximum number of targets of a draw call, the minimum of GL 3.3. The state uses up to four."""
UNITS = 8
"""Number of textures that a fragment reads: four of words, four of state."""
_BACKEND: dict[str, Any] = {"backend": "egl", "libgl": "libGL.so.1", "libegl": "libEGL.so.1"}
"""The default backend needs a window system; the default library names are those of -dev
packages."""
INSTEAD = "or --set display.renderer=opencl, or display.renderer=numpy, slower"
_SOFTWARE = ("llvmpipe", "softpipe", "swrast", "software", "swiftshader")
"""Parts of the names of GL renderers that run on the processor, in lower case."""
_PACKAGES = f"install a driver ({GL_INSTALL}), {INSTEAD}"
_CAUSES = (
    ("not loaded", "the GL libraries", "libGL.so.1 and libEGL.so.1", "missing"),
    ("found 0 devices", "the EGL vendor", "installed (libegl-mesa0)", "missing"),
    ("eglinitialize failed", "the GL driver", "one that starts (libgl1-mesa-dri)", "missing"),
    ("eglcreatecontext failed", "OpenGL", "version 3.3 or later", "older"),
    ("version", "OpenGL", "version 3.3 or later", "older"),
)
"""Causes of failures: part of the lower-case error text; what, must and actual of the
InputError."""
_PROBE = """
import json
from display.render.context import open_context
from cosim import InputError
try:
    gl = open_context()
    answer = {"ok": True, "renderer": gl.info["GL_RENDERER"], "version": gl.info["GL_VERSION"]}
except InputError as exc:
    answer = {"ok": False, "renderer": str(exc), "version": ""}
print(json.dumps(answer))
"""


def open_context() -> moderngl.Context:
    """Creates a context without a window. It belongs to the thread that creates it and is not valid
    after a fork.

    Raises:
        InputError: there is no GL or EGL library, no EGL vendor or no driver, GL is below 3.3, or
            its limits are below the needs of the shaders; or a parent of this process has created
            one before it forked.
    """
    use("OpenGL")
    # Mesa would repeat the error on standard error.
    os.environ.setdefault("EGL_LOG_LEVEL", "fatal")
    try:
        context = moderngl.create_context(require=GL, standalone=True, **_BACKEND)
    except Exception as exc:  # glcontext raises Exception itself
        raise _refused(exc) from None
    try:
        _check_limits(context.info)
    except InputError:
        context.release()
        raise
    return context


def software(context: moderngl.Context) -> bool:
    """Whether GL runs on the processor."""
    name = str(context.info["GL_RENDERER"]).lower()
    return any(part in name for part in _SOFTWARE)


def gl_packages() -> tuple[str, ...]:
    """Debian packages of a headless GL; () if the user has set the loader to other drivers."""
    loader = ("__EGL_VENDOR_LIBRARY_FILENAMES", "__EGL_VENDOR_LIBRARY_DIRS")
    return () if any(os.environ.get(name) for name in loader) else _DEBIAN


def _refused(exc: Exception) -> InputError:
    text = " ".join(str(exc).split())
    for words, what, must, actual in _CAUSES:
        if words in text.lower():
            packages = gl_packages() if actual == "missing" else ()
            return MissingPackages(what, must, f"{actual} ({text})", _PACKAGES, packages)
    return InputError("the GL context", "available", f"refused ({text})", _PACKAGES)


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
    """The error for a context that does not work any more."""
    return InputError(
        "the GL context", "valid until the end of the run", f"lost during the run ({why})",
        "run it again, with --resume if the run has a checkpoint, " + INSTEAD,
    )  # fmt: skip


def check_alive(context: moderngl.Context) -> None:
    """Raises InputError for a context that was lost or released, or that has no more memory."""
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
    """Whether a context can be created; and the renderer with its GL version, or the error
    message."""
    try:
        child = subprocess.run(
            python_child(_PROBE), capture_output=True, timeout=60,
            encoding="utf-8", errors="replace",
        )  # fmt: skip
        answer = json.loads(child.stdout.strip().splitlines()[-1])
    except subprocess.TimeoutExpired:
        return False, "the GL driver did not answer within a minute"
    except (json.JSONDecodeError, IndexError):
        return False, f"the GL driver ended its process ({child.returncode})"
    return answer["ok"], " ".join(filter(None, (answer["renderer"], answer["version"])))
