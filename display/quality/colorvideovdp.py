"""ColorVideoVDP of the slow motion of each display against that of the true light.

Mantiuk et al., ACM Trans. Graphics 43:129, 2024. Its unit is JOD: 10 if no difference is visible, 1
less if 75 % of observers prefer the reference. It models the visibility of differences in space and
time. The package `cvvdp` (an extra, it installs PyTorch) computes it; without the package there is
no value. It runs in a process of its own: PyTorch and OpenCL bring different versions of LLVM, and
together they crash.
"""

from __future__ import annotations

import json
import math
import subprocess
import sys
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from cosim import PS
from cosim.compute.forks import python_child
from cosim.errors import say
from display.observe.slow_motion import SlowMotion

Frames = npt.NDArray[np.uint8]
_CONTRAST: Final = 1e6
"""Contrast of a panel in a dark room, whose black is below the least luminance of the metric."""
_RATE: Final = 500.0
"""Highest frame rate of the comparison, Hz. Eyes do not see flicker above half of it; the time of
the computation grows with its square."""


def color_video_vdp(
    frames: Mapping[str, Frames], truth: str, motion: SlowMotion, per_degree: float,
    luminance: float,
) -> dict[str, float]:  # fmt: skip
    """JOD of each display, without the first quarter of the frames, in which pixels still wait for
    their first spikes.

    Args:
        frames: frames by display, (frames, h, w) uint8 with the sRGB curve applied.
        truth: name of the reference among the displays.
        motion: times and size of the frames.
        per_degree: pixels of a display per degree of visual angle, before reduction to frames.
        luminance: luminance of white, cd/m2.

    Returns:
        JOD by display, without the reference: NaN if the package fails, {} if it is not installed
        or there are fewer than four frames.
    """
    if find_spec("pycvvdp") is None or motion.count < 4:
        return {}
    names = [name for name in frames if name != truth]
    rate = PS / motion.exposure
    group = min(math.ceil(rate / _RATE), motion.count // 4)
    with TemporaryDirectory() as folder:
        path = Path(folder) / "frames.npz"
        shown = (_grouped(frames[name], group) for name in names)
        tests: dict[str, Any] = {f"test{n}": light for n, light in enumerate(shown)}
        sizes = np.array([rate / group, per_degree / motion.by, luminance])
        np.savez(path, truth=_grouped(frames[truth], group), sizes=sizes, **tests)
        call = f"from {__name__} import main; main()"
        done = subprocess.run(
            python_child(call, str(path)), capture_output=True, encoding="utf-8",
            errors="replace", check=False,
        )  # fmt: skip
    if done.returncode:
        say(f"ColorVideoVDP failed: {done.stderr.strip()[-200:]}")
        return dict.fromkeys(names, float("nan"))
    return dict(zip(names, json.loads(done.stdout.splitlines()[-1]), strict=True))


def _grouped(frames: Frames, group: int) -> npt.NDArray[np.float32]:
    """Linear light of the frames after the first quarter, white = 1, mean over groups: (groups, h,
    w) float32."""
    x = np.arange(256) / 255
    light = np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4).astype(np.float32)
    frames = frames[len(frames) // 4 :]
    count = len(frames) // group
    return np.asarray(
        light[frames[: count * group]].reshape(count, group, *frames.shape[1:]).mean(axis=1)
    )


def _measure(path: Path) -> list[float]:
    """JOD of each test in a file of `color_video_vdp`, in their order."""
    import pycvvdp
    from pycvvdp.display_model import vvdp_display_geometry, vvdp_display_photo_eotf

    with np.load(path) as stored:
        arrays: dict[str, Any] = dict(stored)
    truth, (rate, per_degree, luminance) = arrays["truth"], arrays["sizes"].tolist()
    metric: Any = pycvvdp.cvvdp(
        display_photometry=vvdp_display_photo_eotf(luminance, contrast=_CONTRAST, EOTF="linear"),
        display_geometry=vvdp_display_geometry(truth.shape[:0:-1], ppd=per_degree),
        quiet=True,
    )
    tests = [arrays[f"test{n}"] for n in range(len(arrays) - 2)]
    return [
        float(
            metric.predict(
                test * luminance, truth * luminance, dim_order="FHW", frames_per_second=rate
            )[0]
        )
        for test in tests
    ]


def main() -> None:
    """Prints the results for the file that the first argument names."""
    print(json.dumps(_measure(Path(sys.argv[1]))))
