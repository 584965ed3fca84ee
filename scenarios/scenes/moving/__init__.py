"""Moving scenes whose exposures are known in closed form, for measurements of motion."""

from scenarios.scenes.moving.exposed import ExposedScene, ExposedSource
from scenarios.scenes.moving.spot import Spot
from scenarios.scenes.moving.texture import Texture

__all__ = ["ExposedScene", "ExposedSource", "Spot", "Texture"]
