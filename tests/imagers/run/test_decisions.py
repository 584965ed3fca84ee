"""Decisions of the imagers' controllers under a plan: what the check says of them is held against
the same run with everything, whose controller decides by itself."""

import numpy as np
import pytest

from cosim import PS
from cosim.run.machine import Options
from imagers.adaptive.device.imager import AdaptiveExposure
from imagers.adaptive.device.loop import light_for
from imagers.adaptive.model import AdaptiveJudge
from imagers.adaptive.pixels import AdaptivePixels
from imagers.common.scenery import Course, Still
from imagers.ebaps.device.imager import Ebaps
from imagers.ebaps.model import EbapsJudge
from imagers.ebaps.pixels import EbapsPixels
from imagers.run.check import DecisionCheck, Decisions
from imagers.run.tape import NoTape, Taped
from scenarios.assemble.schema.loading import load
from scenarios.assemble.source.imager import make_view
from scenarios.run import run_scenario

SHAPE = (16, 32)
CMOS = AdaptivePixels(SHAPE)
TUBE = EbapsPixels((32, 64))


class Silent:
    """Progress that says nothing."""

    def start(self, what, total): ...
    def advance(self, count): ...
    def note(self, text): ...


def adaptive():
    return AdaptiveExposure(CMOS)


def ebaps(**registers):
    made = Ebaps(TUBE)
    for name, value in registers.items():
        made.write(name, value)
    return made


def filmed(imager, scene, stop, kept, seed):
    """The exposures of the run, and what the check says of its decisions."""
    full = frozenset(imager.pixels.effects)
    judge = {"adaptive-exposure": AdaptiveJudge, "ebaps": EbapsJudge}[imager.name]
    left_out = bool(full - kept)
    decisions = Decisions(judge(imager, full, kept, seed) if left_out else None, full, seed)
    imager.pixels = Taped(imager.pixels, NoTape(), decisions.add)
    exposures = []
    for frame in imager.film(scene, stop, seed=seed, kept=kept):
        decisions.frame(frame)
        exposures.append(int(frame.end[-1] - frame.begin[-1]))
    return exposures, decisions.result()


def first_difference(one, other):
    return next((n for n, pair in enumerate(zip(one, other, strict=False)) if len({*pair}) > 1),
                None)  # fmt: skip


def test_adaptive_exposure_far_from_every_limit_says_that_nothing_could_flip():
    """192 DN at the shortest exposure, from the first frame on; all noise left out."""
    scene = Still(np.full(SHAPE, light_for(1, 192.0)))
    _, decided = filmed(adaptive(), scene, PS // 8, frozenset({"shot noise"}), 1)
    assert decided.examined > 8 and decided == DecisionCheck(decided.examined, 0, None, 0.0)
    assert decided.text().startswith("no decision of its controller could turn out otherwise")


def test_adaptive_exposure_at_a_limit_flips_and_its_change_is_told():
    """126 DN without the pattern is lengthened to 252; with it some pixel reads 128 and keeps."""
    scene = Still(np.full(SHAPE, light_for(1, 126.5)))
    _, decided = filmed(adaptive(), scene, PS // 8, frozenset(), 1)
    assert decided.differs_at == 0 and decided.close == 1
    assert decided.change == pytest.approx(1.0, abs=0.05)  # twice the exposure
    assert "full physics decides otherwise on frame 0" in decided.text()


@pytest.mark.parametrize("seed", range(3))
def test_adaptive_exposure_flips_where_full_physics_does(seed):
    """Random light, falls and rises of it, lamps, random effects left out."""
    rng = np.random.default_rng(seed)
    flips = 0
    for _ in range(12):
        level = light_for(1 << int(rng.integers(0, 10)), float(rng.uniform(60, 260)))
        lux = np.full(SHAPE, level) * rng.uniform(0.9, 1.0, SHAPE)
        lux[:2, :3] *= rng.choice([1.0, 1.05, 30.0])
        jump = float(10 ** rng.uniform(-2, 2))
        scene = Still(lux, Course(((PS // 20, 1.0), (PS // 20, jump))))
        full = frozenset(CMOS.effects)
        kept = frozenset(e for e in sorted(full) if rng.random() < 0.6)
        exposures, decided = filmed(adaptive(), scene, PS // 6, kept, seed)
        truth, _ = filmed(adaptive(), scene, PS // 6, full, seed)
        differs = first_difference(exposures, truth)
        if decided is None:
            assert kept == full
        elif differs is None:
            # Only the last two frames' decisions are not seen in an exposure.
            assert decided.differs_at is None or decided.differs_at >= len(exposures) - 2
        else:
            assert decided.differs_at == differs - 2
            flips += 1
    assert flips


def test_an_ebaps_in_the_middle_of_its_window_could_not_flip_and_at_its_edge_does():
    """Dark current is left out, which adds 3 %: a limit between the two means is one decision's
    difference, one a tenth below both none."""
    full = frozenset(TUBE.effects)
    kept = full - {"dark current"}
    scene = Still(np.full(TUBE.shape, 1.6e-4))

    def first(way, seed):
        camera = ebaps(loop=0, subtract=0)
        return next(iter(camera.film(scene, PS, seed=seed, kept=way))).state["mean"]

    without, everything = first(kept, 3), first(full, 3)
    assert everything > 1.005 * without
    for low, flips in ((round(0.9 * without), False), (round((without + everything) / 2), True)):
        runs = []
        for way in (kept, full):
            camera = ebaps(subtract=0, window_low=low, window_high=65_535)
            runs.append(filmed(camera, scene, PS // 4, way, 3))
        (exposures, decided), (truth, _) = runs
        differs = first_difference(exposures, truth)
        assert (decided.differs_at is not None) == flips == (differs is not None)
        if flips:
            assert decided.differs_at == 0 and differs == 2
            # One step of 0.64 ms; of the value, a part of which is the black level.
            assert 0.4 * 0.64 / 17.024 < decided.change < 1.1 * 0.64 / 16.384
        else:
            assert decided.close == 0 and "no decision" in decided.text()


@pytest.mark.parametrize("seed", range(3))
def test_an_ebaps_flips_where_full_physics_does(seed):
    """With darks that are taken away, random light and effects left out."""
    rng = np.random.default_rng(10 + seed)
    full = frozenset(TUBE.effects)
    for trial in range(3):
        kept = frozenset(e for e in sorted(full) if rng.random() < 0.75)
        lux = 3e-3 * float(rng.uniform(0.4, 1.5))
        made = []
        for way in (kept, full):
            camera = ebaps(subtract=trial % 2, refresh=trial % 2)
            if trial % 2:
                camera.store_darks()
            made.append(filmed(camera, Still(np.full(TUBE.shape, lux)), PS, way, seed))
        (exposures, decided), (truth, _) = made
        differs = first_difference(exposures, truth)
        if decided is None or differs is None:
            assert decided is None or (decided.differs_at or 99) >= len(exposures) - 2
        else:
            assert decided.differs_at is not None and decided.differs_at < differs


@pytest.mark.slow
def test_a_run_puts_back_what_changes_a_decision(tmp_path):
    """White just below half scale, which noise that is left out decides about: the one run is then
    exposed half as long as the other. The error says so, and is mended where that is too much."""
    found = {}
    for tolerance in (1.0, 0.3):
        keys = [
            "duration=60 ms", "imager.rows=16", "imager.columns=32", f"tolerance={tolerance}",
            "scene.chart=bars", 'scene.course=[["0 ms", 1]]',
        ]  # fmt: skip
        _, loaded = load("adaptive-exposure", [*keys, "scene.illuminance=1 lux"])
        white = float(make_view(loaded, SHAPE).most.max())
        lux = light_for(1, 126.0) / white
        _, loaded = load("adaptive-exposure", [*keys, f"scene.illuminance={lux:g} lux"])
        lines = []
        done = run_scenario(
            "x", loaded, tmp_path / str(tolerance), options=Options(), progress=Silent(), began=0.0,
            report=lambda _, run, lines=lines: lines.append(run.recording.chain.decisions) or [],
        )  # fmt: skip
        found[tolerance] = done.result, lines[0]
    result, decided = found[1.0]
    assert decided.differs_at is not None and decided.change == pytest.approx(0.5, abs=0.05)
    assert result.error.ci[1] >= result.error.value >= decided.change
    assert f"full physics decides otherwise on frame {decided.differs_at}" in result.error.kind
    result, decided = found[0.3]
    assert result.outcome == "ok" and result.error.ci[1] <= 0.3
    assert decided is None or decided.differs_at is None
