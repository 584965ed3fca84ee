"""One-way glass: the camera's stream shown on a display while it is filmed, and what eyes see of it
and of other displays beside it."""

from scenarios.glass.finish import Shown, finish_glass, judge_seen, write_eye_images
from scenarios.glass.glass import Glass, follow, make_glass, short_of

__all__ = [
    "Glass", "Shown", "finish_glass", "follow", "judge_seen", "make_glass", "short_of",
    "write_eye_images",
]  # fmt: skip
