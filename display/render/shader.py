"""The renderer's shaders, put together for what is to be drawn: unrolled, with constants.

The text is in drive.frag and observe.frag; the level of a drive is the drive's own expression. The
switches and the calls of each plane are written here.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib.resources import files

from cosim.spikes.viform import WORD
from display.drives import Drive

__all__ = ["GROUPS", "DriveSwitches", "ObserverSwitches", "states", "vertex"]

PART = 8
"""Terms that are summed before they join a longer sum: shorter chains of float32 round less."""
GROUPS = 4
"""Groups of planes whose light one draw can leave as textures."""


def vertex() -> str:
    """The full-screen triangle."""
    return _text("quad.vert")


def _text(name: str) -> str:
    return (files("display.render") / name).read_text(encoding="utf-8")


def _composed(name: str, defines: dict[str, object], body: list[str]) -> str:
    head = ["#version 330", "#extension GL_ARB_gpu_shader5 : enable"]
    head += [f"#define {key} {value}" for key, value in defines.items()]
    return "\n".join([*head, _text(name).replace("    BODY\n", "\n".join(body) + "\n")])


def states(drive: Drive, emits: bool) -> list[str]:
    """Names of the textures that hold a panel's state, in the order of their targets."""
    return [
        *(["tau", "age"] if drive.spikes else []),
        *(["memory"] if drive.remember is not None else []),
        *(["level"] if emits else []),
    ]


@dataclass(frozen=True)
class DriveSwitches:
    """The switches of a draw of planes.

    Attributes:
        drive: of the panel.
        planes: a power of two up to 128.
        group: planes that share weights, a power of two that divides `planes`.
        images: of still observers, taken at once.
        slopes: whether rows differ in weight.
        spans: whether the light of each group is left as a texture.
        emits: whether the emitter is slower than its drive.
        pulsed: whether a packet is shorter than its plane; only matters with `emits`.
    """

    drive: Drive
    planes: int
    group: int
    images: int
    slopes: bool
    spans: bool
    emits: bool
    pulsed: bool

    @property
    def groups(self) -> int:
        return self.planes // self.group

    @property
    def states(self) -> int:
        """Targets that hold the state."""
        return len(states(self.drive, self.emits))

    @property
    def source(self) -> str:
        names, spans_at = states(self.drive, self.emits), self.states
        defines: dict[str, object] = {
            "INTERVALS": int("tau" in names), "MEMORY": int("memory" in names),
            "EMITS": int(self.emits), "PULSED": int(self.pulsed),
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
    """The switches of a draw for a moving observer.

    Attributes:
        groups: of planes.
        vertical: whether any shift crosses rows.
    """

    groups: int
    vertical: bool

    @property
    def source(self) -> str:
        defines: dict[str, object] = {"GROUPS": self.groups, "VERTICAL": int(self.vertical)}
        return _composed(
            "observe.frag", defines, [f"ADD_SPAN({g}, span{g})" for g in range(self.groups)]
        )
