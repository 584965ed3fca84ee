"""Geometry of the image: a pinhole camera before a flat panel.

The lens is at the origin and looks along z, with x to the right and y down. The sensor stands at v
behind it, where a thin lens of focal length f focuses the distance `focus`: 1/v = 1/f - 1/focus. A
point (X, Y, Z) is imaged at (c X / Z, c Y / Z) from the sensor's centre, with c = v over the
camera's pixel pitch. Distortion and the cos^4 law are not modelled.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from cosim import InputError
from link.air.setting import Aim, AirSetting, Optics

Matrix = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Lengths:
    """Distances and scales behind the lens.

    Attributes:
        image: distance from lens to sensor, m.
        camera: distance from lens to sensor, camera pixels.
        magnification: m = v / d of the panel.
        extension: v / f, 1 + m if the lens is focused at the panel; scales the f-number.
        disc: radius of the image of a panel point by defocus alone, camera pixels.
    """

    image: float
    camera: float
    magnification: float
    extension: float
    disc: float


def lengths(optics: Optics, distance: float) -> Lengths:
    """Lengths behind the lens. Raises InputError if the panel or the focus is within the focal
    length."""
    f, focus = optics.focal_length, distance if optics.focus is None else optics.focus
    for what, at in (("the distance", distance), ("the focus", focus)):
        if not at > f:
            raise InputError(
                what, f"beyond the focal length, {f:g} m", f"{at:g} m", "move it away, or give "
                "link.aim.focal_length a shorter one",
            )  # fmt: skip
    v = f * focus / (focus - f)
    sharp = f * distance / (distance - f)
    disc = f / optics.f_number * abs(v - sharp) / sharp / 2 / optics.camera_pitch
    return Lengths(v, v / optics.camera_pitch, v / distance, v / f, disc)


def _turn(aim: Aim) -> Matrix:
    """Rotation from the panel's axes to the lens's: the tilts, then the rotation."""
    a, b, c = (math.radians(x) for x in (aim.rotation, aim.tilt[0], aim.tilt[1]))
    roll = np.array([[math.cos(a), -math.sin(a), 0], [math.sin(a), math.cos(a), 0], [0, 0, 1]])
    # Positive tilt: the panel's right (lower) side is further away.
    yaw = np.array([[math.cos(b), 0, -math.sin(b)], [0, 1, 0], [math.sin(b), 0, math.cos(b)]])
    pitch = np.array([[1, 0, 0], [0, math.cos(c), -math.sin(c)], [0, math.sin(c), math.cos(c)]])
    return np.asarray(roll @ yaw @ pitch, np.float64)


def image_of(optics: Optics, aim: Aim, air: AirSetting, shape: tuple[int, int]) -> Matrix:
    """(3, 3) homography from panel to camera pixels, (x, y, 1).

    Args:
        optics, aim, air: the link.
        shape: (height, width) of the sensor.

    Raises:
        InputError: if part of the panel is at the lens or behind it.
    """
    c, d = lengths(optics, air.distance).camera, air.distance
    turn = _turn(aim)
    scale = np.array([[optics.pitch, 0.0], [0.0, optics.pitch]])
    middle = np.array([(optics.width - 1) / 2, (optics.height - 1) / 2])
    to_panel = np.eye(3)
    to_panel[:2, :2], to_panel[:2, 2] = scale, -scale @ middle
    centre = np.array([aim.offset[0] / c * d, aim.offset[1] / c * d, d])
    world = np.stack([turn[:, 0], turn[:, 1], centre], axis=1) @ to_panel
    view = np.array([[c, 0, (shape[1] - 1) / 2], [0, c, (shape[0] - 1) / 2], [0, 0, 1.0]])
    homography = view @ world
    depth = panel_corners(optics) @ homography[2, :]
    if not (depth > optics.focal_length).all():
        raise InputError(
            "the panel", "wholly before the lens", f"one whose corner is {depth.min():.3g} m away",
            "tilt it less, or move it away with link.distance",
        )  # fmt: skip
    return np.asarray(homography / homography[2, 2], np.float64)


def panel_corners(optics: Optics) -> Matrix:
    """Panel's outer corners in panel pixels, (4, 3): (x, y, 1)."""
    x, y = optics.width - 0.5, optics.height - 0.5
    return np.array([[-0.5, -0.5, 1], [x, -0.5, 1], [x, y, 1], [-0.5, y, 1]])


def affine_at(homography: Matrix, x: float, y: float) -> Matrix:
    """(2, 2) derivative of camera (x, y) by panel (x, y), at a panel point."""
    u, v, w = homography @ np.array([x, y, 1.0])
    top = homography[:2, :2] - np.outer([u / w, v / w], homography[2, :2])
    return np.asarray(top / w, np.float64)
