"""A renderer with one draw call for each plane: the plain use of moderngl, for the benchmark.

Each plane is a texture with one byte per pixel. The image is an exponential mean in a float32
texture, by blending; reading the previous mean as a texture would take about twice as long. The
unpacking of words to bytes is not timed.
"""

from __future__ import annotations

from typing import Literal

import moderngl
import numpy as np
import numpy.typing as npt

from display.drives import DRIVES
from display.render.context import open_context
from display.render.shader import vertex

KEEP = 1 - 2**-10
"""Weight of the previous mean in the exponential mean."""
_HEAD = """#version 330
#extension GL_ARB_shader_bit_encoding : enable
uniform usampler2D plane, state; uniform sampler2D bytes;
uniform float keep; uniform vec2 shift;
layout(location = 0) out vec4 mean;
"""
_MEAN = "mean = vec4(x, 0.0, 0.0, keep);"
_STATE = """layout(location = 1) out uvec4 after;
void main() {
    ivec2 at = ivec2(gl_FragCoord.xy);
    uvec4 s = texelFetch(state, at, 0);  // tau, age + 1, bits of the balance, of the emitted light
    bool spike = texelFetch(plane, at, 0).x != 0u;
    vec4 held = vec4(s.x == 0u ? 0.0 : 1.0 / float(s.x));
    vec4 run = vec4(s.y == 0u ? uintBitsToFloat(0x7F800000u) : float(s.y));
    vec4 inverse = 1.0 / run, memory = vec4(uintBitsToFloat(s.z));
    vec4 emitted = vec4(uintBitsToFloat(s.w));
    if (spike) {
        memory = REMEMBER;
        held = inverse;
        s = uvec4(s.y, 1u, floatBitsToUint(memory.x), 0u);
    } else if (s.y != 0u) s.y++;
    float x = (LEVEL).x;
    s.w = floatBitsToUint(uintBitsToFloat(s.w) + x);
    after = s;
"""
_OTHERS = {
    "impulse": "void main() { ivec2 at = ivec2(gl_FragCoord.xy);"
    " float x = float(texelFetch(plane, at, 0).x);",
    "pursuit": "void main() { ivec2 at = ivec2(gl_FragCoord.xy); float x = 255.0 *"
    " texture(bytes, (gl_FragCoord.xy + shift) / vec2(textureSize(bytes, 0))).x;",
}
Kind = Literal["impulse", "hold", "causal", "pursuit"]


def _shader(kind: Kind) -> str:
    if kind in _OTHERS:
        return f"{_HEAD}{_OTHERS[kind]}{_MEAN} }}"
    drive = DRIVES[kind]
    state = _STATE.replace("REMEMBER", drive.glsl_remember).replace("LEVEL", drive.glsl)
    return f"{_HEAD}{state}{_MEAN} }}"


class PlaneByPlane:
    """A panel with one drive, or with the impulse drive and a moving eye ("pursuit").

    Args:
        kind: name of the drive, or "pursuit".
        shape: (height, width), pixels.
    """

    def __init__(self, kind: Kind, shape: tuple[int, int]) -> None:
        self._kind, self._planes = kind, 0
        self._context = open_context()
        size = shape[1], shape[0]
        moves, holds = kind == "pursuit", kind in ("hold", "causal")
        self._plane = self._context.texture(size, 1, dtype="f1" if moves else "u1", alignment=1)
        if not moves:
            self._plane.filter = moderngl.NEAREST, moderngl.NEAREST
        self._mean = self._context.texture(size, 1, dtype="f4")
        self._state = [self._context.texture(size, 4, dtype="u4") for _ in range(2 * holds)]
        self._targets = [
            self._context.framebuffer([self._mean, *self._state[n : n + 1]]) for n in range(2)
        ]
        for target in self._targets:
            target.clear()
        self._program = self._context.program(vertex_shader=vertex(), fragment_shader=_shader(kind))
        places = {"plane": 0, "bytes": 0, "state": 1, "keep": KEEP}
        for name, value in places.items():
            uniform = self._program.get(name, None)
            if isinstance(uniform, moderngl.Uniform):
                uniform.value = value
        self._triangle = self._context.vertex_array(self._program, [])

    def show(self, planes: npt.NDArray[np.uint8], shift: float = 0.0) -> npt.NDArray[np.float32]:
        """Shows planes and returns the mean, (height, width) float32.

        Args:
            planes: (n, height, width) of 0 and 1.
            shift: shift along the rows from plane to plane for "pursuit", pixels.
        """
        with self._context:
            self._context.enable(moderngl.BLEND)
            self._context.blend_func = moderngl.ONE_MINUS_SRC_ALPHA, moderngl.SRC_ALPHA
            for n, plane in enumerate(planes, self._planes):
                self._plane.write(plane)
                self._plane.use(0)
                if self._state:
                    self._state[n % 2].use(1)
                moved = self._program.get("shift", None)
                if isinstance(moved, moderngl.Uniform):
                    moved.value = n * shift, 0.0
                self._targets[1 - n % 2].use()
                self._triangle.render(moderngl.TRIANGLES, vertices=3)
            self._planes += len(planes)
            size = self._mean.height, self._mean.width
            return np.frombuffer(self._mean.read(), np.float32).reshape(size)

    def close(self) -> None:
        """Releases the context."""
        self._context.release()
