"""An imager films: frame by frame to disk, its plan checked on patches, and filmed again with an
effect put back where the plan changed more than it may."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from shutil import rmtree
from typing import Any

from cosim import InputError, Interrupted
from cosim.config.toml import to_toml
from cosim.files.whole import whole
from cosim.run.folder import PUT_BACK, mend, room_for
from cosim.run.inputs import sealed
from cosim.run.progress import Progress
from cosim.run.result import viform_version
from rtl_model.imagers.imager import Imager
from rtl_model.imagers.run.decisions import Decided, Decisions
from rtl_model.imagers.run.machine import Taken, take
from rtl_model.imagers.run.paired import Compared, PlanPatches
from rtl_model.imagers.run.planning import Ready, ready_imager
from rtl_model.imagers.run.store import FRAMES, FrameStore
from rtl_model.imagers.run.tape import TAPE, Tape, Taped
from sensor.imagers import Exposed, PixelModel

__all__ = ["Filmed", "film", "film_as_promised", "watched"]

WATCHED = 4
"""Frames, evenly spaced, whose exposures the plan is checked on."""


@dataclass(frozen=True, eq=False)
class Filmed:
    """run: as it was filmed at last. put_back: effects that it had left out before. imager: as it
    stands after the run. seconds: of every stage. resumed: whether a part was there before.
    decided: what was found of its controller's decisions."""

    run: Ready
    taken: list[Taken]
    patches: PlanPatches
    imager: Any
    seconds: dict[str, float]
    put_back: list[str] = field(default_factory=list)
    resumed: bool = False
    decided: Decided | None = None

    @property
    def error(self) -> Compared | None:
        """Of the plan: of the patches, and of a decision that full physics makes otherwise."""
        found, decided = self.patches.planned(), self.decided
        if found is None or decided is None or decided.flipped is None:
            return found
        change = max(found.mean, decided.change)
        return replace(found, mean=change, high=max(found.high, decided.change))


def _identity(run: Ready) -> str:
    kept = " ".join(sorted(run.kept))
    return f"{viform_version()}\n{kept}\n{sealed(to_toml(run.scenario))}"


def watched(frames: int) -> list[int]:
    """Numbers of frames to check: within the run, its beginning aside where it is long."""
    return sorted({int((n + 0.5) * frames / WATCHED) for n in range(WATCHED)})


class _Clock:
    """Seconds that calls of one kind take."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function, self.seconds = function, 0.0

    def __call__(self, *given: Any) -> Any:
        begin = time.perf_counter()
        try:
            return self._function(*given)
        finally:
            self.seconds += time.perf_counter() - begin


class _Timed:
    """A scenery that says how long it took."""

    def __init__(self, scenery: Any) -> None:
        self.shape = scenery.shape
        self.lux_seconds = _Clock(scenery.lux_seconds)


def film(run: Ready, folder: Path, resume: bool, progress: Progress, trace: Path | None) -> Filmed:
    """Films the scenario's duration into the folder. Raises Interrupted, InputError."""
    effects = list(run.pixels.effects)
    out = [name for name in effects if name not in run.kept]
    patches = PlanPatches(effects, out, run.scenario.seed, watched(run.expected.frames))
    tape = Tape(folder / TAPE, _identity(run), resume)
    resumed = tape.found > 0
    scenery = _Timed(run.view.scenery)
    imager: Any = run.machine.make()
    decisions = Decisions(imager, frozenset(effects), run.kept, run.scenario.seed)
    judge = _Clock(decisions.frame)

    def seen(rows: Exposed, pixels: PixelModel) -> None:
        patches(rows, pixels)
        decisions.see(rows, pixels)

    watch = _Clock(seen)
    imager.pixels = Taped(imager.pixels, tape, watch)
    taken: list[Taken] = []
    store = FrameStore(folder / FRAMES, run.pixels.bits)
    rows, columns = run.machine.shape
    total = max(run.expected.frames, 1)
    progress.start(f"{run.name}: about {total} frames of {columns} x {rows}", total)
    began = time.perf_counter()
    storing = 0.0
    try:
        with room_for("the frames", folder):
            frames = _frames(imager, scenery, run, trace)
            for frame in frames:
                judge(frame)
                begin = time.perf_counter()
                store.append(frame)
                taken.append(take(frame))
                storing += time.perf_counter() - begin
                progress.advance(min(len(taken), total))
            store.finish()
    except KeyboardInterrupt:
        tape.sync()
        raise Interrupted(len(taken), total, mend(folder), "frames") from None
    finally:
        tape.close()
    light, checked = scenery.lux_seconds.seconds, watch.seconds + judge.seconds
    seconds = {
        "light": light,
        "imager": time.perf_counter() - began - light - checked - storing,
        "check": checked,
        "frames to disk": storing,
    }
    return Filmed(run, taken, patches, imager, seconds, [], resumed, decisions.decided())


def _frames(imager: Imager, scenery: Any, run: Ready, trace: Path | None) -> Any:
    return imager.film(scenery, run.stop, seed=run.scenario.seed, kept=run.kept, trace=trace)


def _short(filmed: Filmed) -> list[str]:
    """What to put back: the effect whose absence changed most, where the error's upper limit is
    above the tolerance."""
    run, error = filmed.run, filmed.error
    tolerance, out = run.scenario.tolerance, list(run.plan.left_out)
    if error is None or not out or error.high <= tolerance:
        return []
    found: dict[str, Compared | None] = {name: filmed.patches.measured(name) for name in out}
    return [max(out, key=lambda name: getattr(found[name], "high", 0.0))]


def _before(path: Path) -> list[str]:
    """What the run that is gone on with has put back so far."""
    if not path.exists():
        return []
    try:
        names = json.loads(path.read_text(encoding="utf-8"))
        if not (isinstance(names, list) and all(isinstance(name, str) for name in names)):
            raise ValueError("not a list of names")
    except (OSError, ValueError) as exc:
        raise InputError(
            PUT_BACK, "the one that this run wrote", "a damaged file",
            f"remove {path.parent} and run it afresh",
        ) from exc  # fmt: skip
    return list(names)


def film_as_promised(
    run: Ready, folder: Path, resume: bool, progress: Progress, trace: Path | None
) -> Filmed:
    """Films, and films again with an effect put back as long as the error may be too large."""
    kept = folder / PUT_BACK
    back = _before(kept) if resume and (folder / TAPE).exists() else []
    if back:
        run = ready_imager(run.name, run.scenario, run.machine, back)
    while True:
        filmed = film(run, folder, resume, progress, trace)
        more = _short(filmed)
        if not more:
            return Filmed(
                filmed.run, filmed.taken, filmed.patches, filmed.imager, filmed.seconds, back,
                filmed.resumed, filmed.decided,
            )  # fmt: skip
        error = filmed.error
        high = error.high if error is not None else 0.0
        back += more
        progress.note(
            f"the error may be {high:.2g} without {more[0]}: it is put back and the run done again"
        )
        (folder / TAPE).unlink(missing_ok=True)
        rmtree(folder / FRAMES, ignore_errors=True)
        with whole(kept) as part:
            part.write_text(json.dumps(back), encoding="utf-8")
        run, resume = ready_imager(run.name, run.scenario, run.machine, back), False
