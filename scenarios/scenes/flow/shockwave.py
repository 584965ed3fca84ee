"""Formation of the shock wave on a model at the start of a Mach 6 quiet tunnel (Huang 2022, fig.
6).

The paper shows images of a spike camera with 100 000 pixels and gives no details (section 6), so
the scene is designed here. Nozzle and stagnation state are those of the M6HQWT, a Mach 6 quiet
tunnel with an exit of 120 mm, 1 to 5 MPa and about 500 K (abstract of its design paper).
docs/shockwave.md has the equations and marks the models among them.

The waves of the start (`start_flow`) cross the picture as planes. Upstream of the starting shock
the flow is already steady, because disturbances do not propagate upstream in supersonic flow. Only
the bow shock of a sphere, whose nose region is subsonic, needs time to settle: see
`Shockwave.swell`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Literal

import numpy as np
import numpy.typing as npt

from cosim import Box, Plane
from cosim.config.amounts import at_most
from scenarios.scenes.drawing.canvas import NOTHING, View, check_instant, check_number, check_shape
from scenarios.scenes.drawing.shading import noise
from scenarios.scenes.flow.gasdynamics import (
    Gas,
    Start,
    behind_normal,
    detachment,
    nozzle,
    reflected,
    shock_mach,
    stalling,
    start_flow,
)
from scenarios.scenes.flow.sightlines import SWELLS, WIDTH, Bench, fine, flows, grain, mix, swirl
from scenarios.scenes.flow.steadyflow import Sphere, Wedge

STAGNATION_PRESSURE, STAGNATION_TEMPERATURE = 1e6, 500.0
"""Stagnation state of the M6HQWT: its lowest pressure, Pa, and its temperature, K."""
ROOM = 293.0
"""Temperature of the chamber before the start, K."""
CHAMBER, LEAST, MOST = 0.85, 0.45, 0.95
"""Default pressure of the chamber and its limits, over the pressure at which the tunnel does not
start. Below the lower limit the gas behind the starting shock is nearly sonic (assumed)."""

# Lengths over the picture's shorter side, all assumed: distance of the nozzle exit from the left
# edge; foremost point of the model; length and maximum half height of a wedge; afterbodies.
EXIT, NOSE = 0.25, -0.36
LENGTH, TALL, FLAT, BODY = 0.54, 0.19, 0.20, 0.40

EDDY, RIPPLE = 0.09, 0.010
"""Size of the eddies in the starting gas and of the ripples of the contact, over the shorter side
(assumed)."""
LIFE = 2.0e-4
"""Time in which the reflected wave of the primary shock fades out, s."""
SETTLED = 1e-4
"""Relative difference of the standoff below which the shock counts as steady: 0.001 pixels."""
SLOW = 0.2
"""Factor on the speed of eddies, which are smooth over 20 pixels."""


@dataclass(frozen=True)
class Shockwave:
    """A schlieren image of a model during the start of the tunnel.

    Attributes:
        shape: (height, width), pixels, each 8 to 2000.
        mach: Mach number of the nozzle, 4 to 7.
        model: "wedge", two-dimensional, or "sphere", a hemisphere on a cylinder.
        angle: half angle of a wedge, rad.
        radius: radius of a sphere, m.
        start: instant at which the waves leave the nozzle exit, s.
        chamber: pressure of the chamber before the start, Pa; None for CHAMBER of the pressure at
            which the tunnel does not start.
        knife: angle between the flow and the visible gradient, rad.
        field: length of the picture's shorter side, m.

    Raises:
        ValueError: a value is out of range, such as a wedge without an attached shock and
            supersonic flow behind it, or a pressure at which the tunnel does not start.
    """

    shape: tuple[int, int]
    mach: float = 6.0
    model: Literal["wedge", "sphere"] = "wedge"
    angle: float = math.radians(15.0)
    radius: float = 0.010
    start: float = 0.002
    chamber: float | None = None
    knife: float = math.radians(45.0)
    field: float = 0.0625

    def __post_init__(self) -> None:
        check_shape(self.shape)
        check_number("mach", self.mach, 4.0, 7.0)
        check_number("start", self.start, 0.0, 86400.0, "s")
        check_number("knife", self.knife, -0.5 * math.pi, 0.5 * math.pi, "rad")
        check_number("field", self.field, 0.005, 0.5, "m")
        if self.model not in ("wedge", "sphere"):
            raise ValueError(f'model must be "wedge" or "sphere", not {self.model!r}')
        if self.model == "wedge":
            most = math.degrees(detachment(self.mach)[0])
            if not 2.0 <= math.degrees(self.angle) <= most:
                raise ValueError(
                    f"angle must be 2 to {at_most(most, 4)} deg, where the shock at Mach "
                    f"{self.mach:g} is attached and the flow behind it supersonic, not "
                    f"{math.degrees(self.angle):g}"
                )
        else:
            check_number("radius", self.radius, 0.02 * self.field, 0.25 * self.field, "m")
        stall = stalling(self.stream, ROOM)
        if self.chamber is not None and not LEAST * stall <= self.chamber <= MOST * stall:
            least, highest = math.ceil(LEAST * stall), math.floor(MOST * stall)
            raise ValueError(
                f"chamber must be {least} to {highest} Pa at Mach "
                f"{self.mach:g}, where the tunnel starts with two shocks, not {self.chamber:g}"
            )

    @property
    def stream(self) -> Gas:
        """The flow of the nozzle."""
        return nozzle(self.mach, STAGNATION_PRESSURE, STAGNATION_TEMPERATURE)

    @property
    def view(self) -> View:
        return View(self.shape, self.field)

    @property
    def nose(self) -> float:
        """x of the foremost point of the model in the picture plane, m."""
        return NOSE * self.field

    @property
    def left(self) -> float:
        """x of the left edge of the picture, m."""
        return -0.5 * self.shape[1] * self.view.pixel

    @property
    def waves(self) -> Start:
        return _parts(self).waves

    @property
    def body(self) -> Wedge | Sphere:
        return _parts(self).body

    def place(self, t: float, speed: float) -> float:
        """x at t of a wave that left the nozzle exit at `speed`, m; far upstream before the
        start."""
        since = check_instant(t) - self.start
        return self.left - EXIT * self.field + speed * since if since >= 0.0 else -1e3

    def swell(self, t: float) -> float:
        """Standoff of the shock of a sphere at t over the steady standoff, at least 1.

        A model: the starting shock moves downstream and becomes the bow shock of the nose. Let x be
        its position relative to the nose, and s = W R / u the distance that it moves at its speed W
        in the time R / u in which the gas behind it passes the nose. The shock on the axis is at
        -s log(exp(-x/s) + exp(d/s)) for a standoff d: at x while it is far upstream, then it
        approaches -d exponentially with the time constant R / u.
        """
        parts = _parts(self)
        if not isinstance(parts.body, Sphere):
            return 1.0
        waves, d = parts.waves, parts.body.standoff
        s = self._way
        x = self.place(t, waves.starting) - self.nose
        ahead = float(np.logaddexp(-x / s, d / s)) * s
        swell = max(ahead / d, 1.0)
        return swell if swell - 1.0 > SETTLED else 1.0

    def path(self, t: float) -> Plane:
        """Density integrated along sight lines at t, kg/m2, (H, W) float32."""
        parts, waves = _parts(self), self.waves
        xs, xp = self.place(t, waves.starting), self.place(t, waves.primary)
        xc = self.place(t, waves.cold.velocity)
        right = self.left + self.shape[1] * self.view.pixel + self.view.pixel
        if xs > right and self.swell(t) == 1.0:
            return parts.settled
        far = max(xc - self.left + EXIT * self.field, 0.0)
        ripple = parts.ripple * min(far / self.field, 1.0)
        since = t - self.start - (self.nose - self.left + EXIT * self.field) / waves.primary
        ring = (0.0, 0.0, 0.0, 1.0)
        if 0.0 < since < LIFE:
            r = waves.hot.sound * since
            fade = (1.0 - since / LIFE) ** 2
            gain = parts.echo * fade * parts.body.height / (parts.body.height + r)
            ring = (self.nose + waves.hot.velocity * since, r, gain, 0.5 * parts.body.height)
        gas = (
            WIDTH, waves.flow.density, waves.cold.density, waves.hot.density, waves.rest.density,
            waves.cold.mach**2, waves.hot.mach**2,
        )  # fmt: skip
        out = np.empty(self.shape, np.float32)
        mix(
            out, parts.flow(self.swell(t)), parts.swirl, parts.grain, parts.x, parts.y, ripple,
            self.view.pixel, xs, xc, xp, gas, ring,
        )  # fmt: skip
        return out

    def reflectance(self, t: float) -> Plane:
        """The picture at t, s, (H, W) float32 in [0, 1]; 1 is the lamp without a knife edge."""
        return _parts(self).bench.picture(self.path(t))

    def episodes(self) -> list[tuple[float, float, float]]:
        """Intervals of motion (start, s; stop, s; greatest speed, pixels/s), in order and without
        overlap. Eddies count with SLOW of their speed."""
        waves, pixel = self.waves, self.view.pixel
        way = EXIT * self.field - 2.0 * pixel
        whole = way + (self.shape[1] + 4.0) * pixel
        hit = (self.nose - self.left + EXIT * self.field) / waves.primary
        first = way / waves.primary
        passed = max(whole / waves.primary, hit + LIFE)
        contact = max((whole + 2 * RIPPLE * self.field) / waves.cold.velocity, passed)
        started = max(whole / waves.starting, contact, self._settled())
        fast = max(waves.primary, waves.hot.velocity + waves.hot.sound)
        slow = max(waves.starting, SLOW * waves.cold.velocity)
        ends = (first, passed, contact, started)
        return [
            (self.start + a, self.start + b, v / pixel)
            for (a, b), v in zip(pairwise(ends), (fast, waves.cold.velocity, slow), strict=True)
            if b > a
        ]

    def _settled(self) -> float:
        """Time after the start at which the shock of a sphere is steady, s: `swell` at SETTLED."""
        body, waves = self.body, self.waves
        if not isinstance(body, Sphere):
            return 0.0
        s, d = self._way, body.standoff
        x = -d - s * math.log(math.expm1(SETTLED * d / s))
        return (self.nose + x - self.left + EXIT * self.field) / waves.starting

    @property
    def _way(self) -> float:
        """Distance that the starting shock moves while the gas behind it passes the radius of the
        sphere, m."""
        return self.waves.starting * self.radius / self.waves.cold.velocity

    def speed(self) -> float:
        """Upper bound of the speed of any edge, pixels/s."""
        return max(v for _, _, v in self.episodes())

    def moving(self, start: float, stop: float) -> Box:
        """Box (y0, y1, x0, x1) that contains all changes between two instants, s."""
        start, stop = check_instant(start), check_instant(stop)
        if stop < start:
            raise ValueError(f"stop must be at or after start {start}, not {stop}")
        spans = self.episodes()
        if stop == start or stop <= spans[0][0] or start >= spans[-1][1]:
            return NOTHING
        pixel, (height, width) = self.view.pixel, self.shape
        last = self.place(start, self.waves.starting)
        if isinstance(self.body, Sphere):
            last = min(last, self.nose - self.swell(start) * self.body.standoff)
        x0 = math.floor((last - self.left) / pixel) - 3
        x1 = math.ceil((self.place(stop, self.waves.primary) - self.left) / pixel) + 4
        x0, x1 = min(max(x0, 0), width), min(max(x1, 0), width)
        return (0, height, x0, x1) if x0 < x1 else NOTHING

    def points(self) -> list[tuple[int, int, str]]:
        """Characteristic pixels (row, column, label)."""
        body, nose, f = self.body, self.nose, self.field
        h, base = body.height, self.nose + body.base
        y = 0.36 * f
        front = nose + float(body.front(np.array(y)))
        before = nose + float(body.front(np.array(0.0)))
        at = {
            "free stream": (self.left + 0.15 * f, -0.2 * f),
            "ahead of the nose": (before - 2.5 * self.view.pixel, 0.0),
            "the shock, near": (nose + float(body.front(np.array(h))), -h),
            "the shock, far": (front, -y),
            "the shock, below": (front, y),
            "behind the shock": (front + 0.12 * f, -y),
            "above the shoulder": (nose + body.base - 0.5 * FLAT * f, -h - 0.05 * f),
            "behind the base": (base + 0.04 * f, -0.8 * h),
            "wake": (base + 0.22 * f, -0.55 * h),
            "model": (base - 0.1 * f, 0.0),
        }
        return [(*self.view.point(x, y), label) for label, (x, y) in at.items()]


@dataclass(eq=False)
class _Parts:
    """The constant data of a scene. Arrays of the picture are (H, W).

    Attributes:
        waves: waves of the start.
        body: model.
        bench: schlieren bench.
        x, y: coordinates of columns (W,) and rows (H,), m.
        ripple: ripple of the contact in each row, m, (H,).
        swirl: integral of 1 - V^2 of incompressible flow, m.
        grain: relative density of eddies, (H, 2 W).
        flows: steady flow at each of SWELLS.
        echo: density times length of the reflected shock, kg/m2.
        settled: density along sight lines of the steady flow, kg/m2.
    """

    waves: Start
    body: Wedge | Sphere
    bench: Bench
    x: npt.NDArray[np.float64]
    y: npt.NDArray[np.float64]
    ripple: npt.NDArray[np.float64]
    swirl: Plane
    grain: Plane
    flows: list[Plane]
    echo: float
    settled: Plane

    def flow(self, swell: float) -> Plane:
        """The steady flow with the standoff of the shock times `swell`, interpolated linearly."""
        m = int(np.searchsorted(SWELLS, swell, side="right")) - 1
        if m >= len(self.flows) - 1:
            return self.flows[-1]
        part = (swell - SWELLS[m]) / (SWELLS[m + 1] - SWELLS[m])
        if part == 0.0:
            return self.flows[m]
        return self.flows[m] + np.float32(part) * (self.flows[m + 1] - self.flows[m])


@lru_cache(maxsize=2)
def _parts(scene: Shockwave) -> _Parts:
    view, f = scene.view, scene.field
    stream = scene.stream
    chamber = scene.chamber or CHAMBER * stalling(stream, ROOM)
    waves = start_flow(stream, chamber, ROOM)
    body: Wedge | Sphere
    if scene.model == "wedge":
        length = min(LENGTH * f, TALL * f / math.tan(scene.angle))
        body = Wedge(stream, scene.angle, length, FLAT * f)
    else:
        body = Sphere(stream, scene.radius, BODY * f)
    height, width = scene.shape
    x = (np.arange(width) + 0.5 - 0.5 * width) * view.pixel
    y = (np.arange(height) + 0.5 - 0.5 * height) * view.pixel
    at, up = x[None, :] - scene.nose, y[:, None]
    hidden = fine(
        lambda a, b: ((a > 0.0) & (np.abs(b) < body.surface(a))).astype(np.float32),
        at, up, view.pixel,
    )  # fmt: skip
    way = waves.starting * scene.radius / waves.cold.velocity
    steady = flows(body, at, up, way)
    bench = Bench.build(scene.shape, view.pixel, scene.knife, hidden.astype(np.float32))
    # The reflection of the primary shock at a wall.
    back = reflected(waves.hot.pressure / waves.rest.pressure)
    gain = (behind_normal(shock_mach(back))[1] - 1.0) * waves.hot.density
    echo = gain * (WIDTH * math.sin(scene.angle) if scene.model == "wedge" else 2.0 * body.height)
    return _Parts(
        waves, body, bench, np.asarray(x, np.float64), np.asarray(y, np.float64),
        2.0 * RIPPLE * f * (noise(y / (0.08 * f), np.zeros(height), 43) - 0.5),
        swirl(body, at, up).astype(np.float32),
        grain(x, y, EDDY * f),
        steady, echo,
        (stream.density * (WIDTH + steady[0])).astype(np.float32),
    )  # fmt: skip
