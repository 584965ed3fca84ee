"""The catalogue of scenes: the key `kind` of [scene] selects one of them."""

from __future__ import annotations

from typing import Annotated, get_args

from pydantic import Field

from scenarios.scenes.kinds.film import FilmScene
from scenarios.scenes.kinds.objects import ObjectsScene
from scenarios.scenes.kinds.shockwave import ShockwaveScene
from scenarios.scenes.kinds.star import StarScene
from scenarios.scenes.kinds.step import StepScene
from scenarios.scenes.kinds.sun_and_stars import SunAndStarsScene
from scenarios.scenes.kinds.target import TargetScene
from scenarios.scenes.kinds.wave import WaveScene

SceneSection = Annotated[
    FilmScene
    | WaveScene
    | ShockwaveScene
    | StarScene
    | StepScene
    | SunAndStarsScene
    | TargetScene
    | ObjectsScene,
    Field(discriminator="kind"),
]
"""The section [scene], of any kind."""


def scene_keys(kind: str) -> frozenset[str] | None:
    """The keys of a kind of scene; None for an unknown kind."""
    for scene in get_args(get_args(SceneSection)[0]):
        if kind in get_args(scene.model_fields["kind"].annotation):
            return frozenset(scene.model_fields)
    return None
