"""The section of a report with the motion between the frames of a clip."""

from __future__ import annotations

import numpy as np

from cosim.config.amounts import number, percent
from cosim.light.source import Source
from cosim.report.parts import figure
from cosim.report.pictures import busiest_box, crop
from cosim.report.png import for_display, to_linear_bytes
from scenarios.scenes.clips.motion_film import MotionFilm


def motion_section(source: Source) -> str:
    """HTML of the section: both kinds of interpolation between the two frames for which they differ
    most, where they differ most. "" for any other scene, and for a clip without motion."""
    example = source.example() if isinstance(source, MotionFilm) else None
    if not isinstance(source, MotionFilm) or example is None:
        return ""
    difference = np.abs(example.motion - example.linear)
    box = busiest_box(difference, max(64, min(source.shape) // 2))
    top = max(float(difference.max()), 1e-6)
    linear, motion = (crop(for_display(plane), box) for plane in (example.linear, example.motion))
    share, rms = (source.metrics[f"motion_{name}"].value for name in ("linear", "difference"))
    pictures = (
        figure(linear, "linear interpolation", exact=True)
        + figure(motion, "motion", exact=True)
        + figure(
            crop(to_linear_bytes(difference / np.float32(top)), box),
            f"their difference, 0 to {number(top, 2)} mapped to black to white",
            exact=True,
        )
    )
    return (
        "<h2>Motion between frames</h2><p>The light midway between the two frames of the clip for "
        f"which motion matters most, {number(example.seconds * 1e3, 4)} ms into the run, in the "
        f"square in which it matters most. In this run the flows forward and backward disagree for "
        f"{percent(share)} of the pixels, which are interpolated linearly; midway between frames "
        f"the light differs from linear interpolation by {number(rms, 2)} RMS, white = 1.</p>"
        f'<div class="grid by3">{pictures}</div>'
    )
