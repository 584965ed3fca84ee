"""The source that a scenario's [scene] section asks for."""

from __future__ import annotations

import math
from pathlib import Path

from cosim import Clock, InputError
from cosim.light.source import Source
from scenarios.scenes.charts.sky import SkySource
from scenarios.scenes.charts.step import StepSource
from scenarios.scenes.clips.film import FilmSource
from scenarios.scenes.drawing.paced import PacedSource
from scenarios.scenes.sections import (
    FilmScene,
    SceneSection,
    ShockwaveScene,
    StarScene,
    StepScene,
    SunAndStarsScene,
    TargetScene,
)
from scenarios.scenes.source import AnalyticSource

__all__ = ["make_source"]


def make_source(
    scene: SceneSection,
    shape: tuple[int, int],
    clock: Clock,
    cycles: int,
    aligned: bool = True,
) -> Source:
    """The scene on a (height, width) grid for a run of so many cycles."""
    if isinstance(scene, StepScene):
        stop = clock.edge(cycles)
        return StepSource(shape, scene.illuminance, scene.before, scene.after, scene.at, stop)
    if isinstance(scene, TargetScene):
        from scenarios.scenes.charts.target import TargetSource  # brings numba with it

        return TargetSource(scene, shape)
    if isinstance(scene, SunAndStarsScene):
        return SkySource(shape, scene.illuminance, scene.dimmest, scene.background, clock)
    if isinstance(scene, FilmScene) and scene.path is not None:
        return FilmSource(
            Path(scene.path), shape, scene.illuminance, clock, cycles, scene.start, scene.frame_rate
        )
    # The drawn scenes bring numba with them, a second of start-up that a clip need not wait for.
    if isinstance(scene, FilmScene) and scene.drawn == "chart":
        from scenarios.scenes.charts.chart import Chart

        return AnalyticSource(Chart(shape), scene.illuminance, clock)
    if isinstance(scene, FilmScene):
        from scenarios.scenes.people.workshop import Workshop

        return AnalyticSource(Workshop(shape, fan=12.0, disc=8.0), scene.illuminance, clock)
    if isinstance(scene, StarScene):
        from scenarios.scenes.charts.star import Star

        star = Star(shape, spokes=scene.spokes, revolutions=scene.rotation)
        return AnalyticSource(star, scene.illuminance, clock)
    if isinstance(scene, ShockwaveScene):
        return _shockwave(scene, shape, clock, cycles, aligned)
    from scenarios.scenes.people.wave import Wave

    return AnalyticSource(Wave(shape, rate=scene.rate), scene.illuminance, clock)


def _shockwave(
    scene: ShockwaveScene, shape: tuple[int, int], clock: Clock, cycles: int, aligned: bool
) -> PacedSource:
    from scenarios.scenes.flow.shockwave import Shockwave

    try:
        tunnel = Shockwave(
            shape,
            mach=scene.mach,
            model=scene.model,
            angle=math.radians(scene.angle),
            radius=scene.radius * 1e-6,
            start=scene.start,
            chamber=scene.chamber,
            knife=math.radians(scene.knife),
        )
    except ValueError as exc:  # what no single key's limits can say, in the scene's own words
        name, _, rest = str(exc).partition(" must be ")
        must, _, given = rest.rpartition(", not ")
        raise InputError(f"scene.{name}", must, given, "change it") from exc
    source = PacedSource(tunnel, scene.illuminance, clock, aligned)
    if tunnel.episodes()[-1][1] * clock.hz > cycles:
        source.degraded.append("the run ends before the flow is steady: lengthen duration")
    return source
