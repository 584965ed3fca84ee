"""Peak memory of a run of a latched camera, stated before the run.

The statement is a fit to measured runs: a part of the program itself, and bytes a pixel of what a
run holds at its peak, which is while it computes its images. The slow tests in
`tests/scenarios/assemble/source/latched/test_memory.py` measure runs against it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from cosim import BLOCK
from cosim.compute.memory import check_program
from cosim.files import kept_bytes
from scenarios.scenes.clips.file_cache import KEPT_BYTES

if TYPE_CHECKING:
    from scenarios.assemble.source.latched.setup import CameraSetup

PROGRAM: Final = 440 * 2**20
"""Bytes of the program with its libraries and compiled kernels."""
IMAGES: Final = 136
"""Bytes a pixel of a run under constant light: state of the pixels, words of the stream, survey,
and intervals and figures of merit of one image."""
INSTANT: Final = 27
"""Bytes a pixel of the images of one instant: truth in float32, two estimates, and intervals."""
PLANE: Final = 17
"""Bytes a pixel of each new plane of light in a block: at the scene, and behind the lens."""
CHARGE: Final = 14
"""Further bytes of such a plane without OpenCL: its charge in the exact tier, Q24.40."""
SHOWN: Final = 730 * 2**20
"""Bytes of the program with a display: also OpenGL and the probes."""
DISPLAY: Final = 630
"""Bytes a pixel of a run with a display: renderer, observers and reference displays."""
SEEN: Final = 300
"""Bytes a pixel of what all observers see of one instant on all displays."""


def peak_memory(setup: CameraSetup, planes: float = 0.0) -> int:
    """Predicted peak memory of a run, bytes.

    Args:
        setup: the camera and its scene.
        planes: new planes of light a cycle, from the survey of the scene.
    """
    pixels = setup.shape[0] * setup.shape[1]
    clip = 0
    if getattr(setup.scenario.scene, "path", None) is not None:
        clip = min(KEPT_BYTES, round(4 * planes * setup.cycles * pixels))
    if setup.display is not None:
        return SHOWN + (DISPLAY + SEEN * len(setup.instants)) * pixels + clip
    light = PLANE + (CHARGE if setup.device is None else 0)
    each = IMAGES + INSTANT * len(setup.instants) + light * planes * min(setup.cycles, BLOCK)
    return PROGRAM + kept_bytes(setup.cycles * pixels // 8) + round(each * pixels) + clip


def check_run_memory(setup: CameraSetup, planes: float = 0.0) -> None:
    """Raises InputError for a run that the free memory does not hold."""
    check_program(
        "the memory of this run", peak_memory(setup, planes),
        "lower sensor.width and sensor.height, or give fewer instants as image.at", loaded=True,
    )  # fmt: skip


def memory_note(setup: CameraSetup, planes: float) -> str:
    """The statement for the user."""
    height, width = setup.shape
    gib = peak_memory(setup, planes) / 2**30
    return f"the run needs about {gib:.2g} GiB of memory at its peak, for {width} x {height} pixels"
