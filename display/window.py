"""A window for pictures, by moderngl-window (the extra `view`)."""

from __future__ import annotations

from typing import Any, Protocol

import moderngl
import numpy as np
import numpy.typing as npt

from cosim import InputError
from display.render.shader import vertex

_FRAGMENT = """#version 330
uniform sampler2D picture; uniform vec2 size;
out vec4 colour;
void main() {
    vec2 at = gl_FragCoord.xy / size;
    colour = vec4(vec3(texture(picture, vec2(at.x, 1.0 - at.y)).x), 1.0);  // row 0 at the top
}
"""
LARGEST = 1000
"""Maximum length of the window's longer side, screen pixels."""


class Window(Protocol):
    """The window of `viform live`.

    Attributes:
        context: GL context of the window, None without one. The renderer must use this context: a
            thread cannot have a context of the window system and one of EGL.
    """

    context: moderngl.Context | None

    def show(self, picture: npt.NDArray[np.uint8]) -> bool:
        """Shows a picture, (height, width) uint8 screen codes; returns False after the user has
        closed the window."""
        ...

    def close(self) -> None:
        """Closes the window."""
        ...


class _ScreenWindow:
    def __init__(self, window: Any, shape: tuple[int, int]) -> None:
        self._window = window
        self.context: moderngl.Context | None = window.ctx
        context = window.ctx
        self._picture = context.texture((shape[1], shape[0]), 1, alignment=1)
        program = context.program(vertex_shader=vertex(), fragment_shader=_FRAGMENT)
        program["size"].value = tuple(map(float, window.buffer_size))
        self._triangle = context.vertex_array(program, [])

    def show(self, picture: npt.NDArray[np.uint8]) -> bool:
        if self._window.is_closing:
            return False
        with self._window.ctx:
            self._picture.write(np.ascontiguousarray(picture))
            self._picture.use(0)
            self._window.use()
            self._window.ctx.enable_only(moderngl.NOTHING)
            self._triangle.render(vertices=3)
            self._window.swap_buffers()
        return not self._window.is_closing

    def close(self) -> None:
        self._window.close()
        self._window.destroy()


def open_window(title: str, shape: tuple[int, int]) -> Window:
    """Opens a window for pictures of `shape` (height, width). The environment variable
    MODERNGL_WINDOW selects another toolkit than pyglet.

    Raises:
        InputError: moderngl-window is not installed, or no window can be opened.
    """
    try:
        from moderngl_window import activate_context, get_local_window_cls
    except ImportError:
        raise InputError(
            "viform live", "run where moderngl-window is installed", "without it",
            "pip install 'moderngl-window>=3.1,<4' into its environment (the extra view)",
        ) from None  # fmt: skip
    scale = min(1.0, LARGEST / max(shape))
    size = max(1, round(shape[1] * scale)), max(1, round(shape[0] * scale))
    try:
        window = get_local_window_cls(None)(
            title=title, size=size, gl_version=(3, 3), resizable=False, vsync=False
        )
    except Exception as exc:  # every toolkit has its own exceptions
        reason = " ".join(str(exc).split()) or type(exc).__name__
        raise InputError(
            "viform live", "run where a window can be opened", f"here ({reason})",
            "start it on a desktop, or use the report of viform run",
        ) from None  # fmt: skip
    activate_context(window=window)
    return _ScreenWindow(window, shape)
