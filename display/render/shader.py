"""The draw calls of the renderer: the planes of a block in pieces, and the shader of each piece,
unrolled, with constants.

The text of the shaders is in drive.frag and observe.frag; each drive provides the expression of its
level. This file adds the switches and the calls for each plane. A piece also has the images that
its planes contribute to.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from importlib.resources import files
from typing import NamedTuple

import numpy as np

from cosim.spikes.viform import WORD
from display.drives import Drive
from display.observe.views import Views

PART = 8
"""Number of terms in a partial sum: shorter chains of float32 have smaller rounding errors."""
GROUPS = 4
"""Maximum number of groups of planes whose light a draw call writes to textures."""


class Piece(NamedTuple):
    """Planes of a block in one draw call.

    Attributes:
        first, planes: first plane, and number of planes.
        group: number of planes in a group with common weights.
        spans: number of the span of each group.
    """

    first: int
    planes: int
    group: int
    spans: list[int]


def pieces(cycles: int, most: int, batch: int) -> Iterator[Piece]:
    """Yields the pieces of a block. Their numbers of planes are powers of two; each piece starts
    at a multiple of its number.

    Args:
        cycles: number of planes of the block.
        most: maximum number of planes in a piece, a power of two.
        batch: number of planes in a span.
    """
    first = 0
    while first < cycles:
        planes = min(most, 1 << (cycles - first).bit_length() - 1)
        group = group_size(planes, batch)
        yield Piece(first, planes, group, [(first + n) // batch for n in range(0, planes, group)])
        first += planes


def group_size(planes: int, batch: int) -> int:
    """Number of planes that always share a span of `batch` planes: the largest power of two that
    divides `batch`, at most `planes`."""
    return min(planes, batch & -batch)


def split_images(views: Views | None) -> tuple[list[int], list[int]]:
    """Numbers of the images of still observers in this block, and of moving observers."""
    if views is None:
        return [], []
    shifts = views.dy, views.dx, views.dy_slope, views.dx_slope
    moves = np.any([shift != 0 for shift in shifts], axis=(0, 2))
    return [n for n in range(views.images) if not moves[n]], list(np.flatnonzero(moves))


def takes_light(views: Views, image: int, spans: list[int]) -> bool:
    """Whether an image has a weight in any of these spans."""
    return bool(views.weight[image, spans].any() or views.slope[image, spans].any())


@dataclass(frozen=True)
class DriveSwitches:
    """The switches of a draw call for planes.

    Attributes:
        drive: drive of the panel.
        planes: number of planes, a power of two up to 128.
        group: number of planes that share weights, a power of two that divides `planes`.
        images: number of images of still observers in this draw call.
        slopes: whether rows have different weights.
        spans: whether the light of each group is written to a texture.
        emits: whether the emitter has a time constant.
        pulsed: whether a packet is shorter than its plane; only relevant with `emits`.
        dark: planes from which on an interval is dark; 0 for none.
    """

    drive: Drive
    planes: int
    group: int
    images: int
    slopes: bool
    spans: bool
    emits: bool
    pulsed: bool
    dark: int = 0

    @property
    def groups(self) -> int:
        return self.planes // self.group

    @property
    def states(self) -> int:
        """Number of targets with the state."""
        return len(states(self.drive, self.emits))

    @property
    def source(self) -> str:
        names, spans_at = states(self.drive, self.emits), self.states
        defines: dict[str, object] = {
            "INTERVALS": int("tau" in names), "MEMORY": int("memory" in names),
            "EMITS": int(self.emits), "PULSED": int(self.pulsed), "DARK": self.dark,
            "SPANS": int(self.spans), "SLOPES": int(self.slopes), "IMAGES": self.images,
            "GROUPS": self.groups, "PLANES": f"{self.planes}u", "FOREVER": "0xFFFFFFFFu",
            "WHOLE": int(self.planes >= WORD), "MASK": f"{(1 << min(self.planes, WORD)) - 1:#x}u",
            "LEVEL_AT": spans_at - 1, "SPANS_AT": spans_at,
            "IMAGES_AT": spans_at + (self.groups if self.spans else 0),
            "LEVEL": self.drive.glsl, "REMEMBER": self.drive.glsl_remember,
        }  # fmt: skip
        return _composed("drive.frag", defines, self._body())

    def _body(self) -> list[str]:
        counted = self.drive.spikes == 0 and not self.emits
        step, body = min(self.group, WORD), []
        for plane in range(self.planes):
            bit, done = plane % WORD, plane + 1
            if bit == 0:
                body.append(f"LOAD(words{plane // WORD})")
            if not counted:
                body.append(f"PLANE({bit})")
            elif done % step == 0:
                body.append(f"COUNT({bit + 1 - step}u, {(1 << step) - 1:#x}u)")
            if done % PART == 0 or done % self.group == 0:
                body.append("PART")
            if done % self.group == 0:
                body.append(f"GROUP({plane // self.group})")
            if done % (PART * self.group) == 0 or done == self.planes:
                body.append("FOLD")
        return body


@dataclass(frozen=True)
class ObserverSwitches:
    """The switches of a draw call for a moving observer.

    Attributes:
        groups: number of groups of planes.
        vertical: whether any shift is across rows.
    """

    groups: int
    vertical: bool

    @property
    def source(self) -> str:
        defines: dict[str, object] = {"GROUPS": self.groups, "VERTICAL": int(self.vertical)}
        return _composed(
            "observe.frag", defines, [f"ADD_SPAN({g}, span{g})" for g in range(self.groups)]
        )


def vertex() -> str:
    """The vertex shader of a full-screen triangle."""
    return _text("quad.vert")


def _text(name: str) -> str:
    return (files("display.render") / name).read_text(encoding="utf-8")


def _composed(name: str, defines: dict[str, object], body: list[str]) -> str:
    head = ["#version 330", "#extension GL_ARB_gpu_shader5 : enable"]
    head += [f"#define {key} {value}" for key, value in defines.items()]
    return "\n".join([*head, _text(name).replace("    BODY\n", "\n".join(body) + "\n")])


def states(drive: Drive, emits: bool) -> list[str]:
    """Names of the textures with the state of a panel, in the order of their targets."""
    return [
        *(["tau", "age"] if drive.spikes else []),
        *(["memory", "emitted"] if drive.remember is not None else []),
        *(["level"] if emits else []),
    ]
