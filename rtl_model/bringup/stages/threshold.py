"""Stage threshold: compares the spike counts of all settings with a closed form, which is
independent of the cycle model.
"""

from __future__ import annotations

from rtl_model.bringup.bench.bench import Bench
from rtl_model.bringup.bench.stage import Figures, StageFault

LEVELS = 16
RULES = ("residual", "hard", "subtract")
_ELECTRONS = 200  # in a 40 kHz tick; divides none of the thresholds
_LEAST_FRAMES = 48  # a pixel at level 15 fires after 21 ticks
_WORD = 1 << 32


def check_threshold(bench: Bench) -> Figures:
    """Runs constant light under each setting; the spikes must be rows x columns x `count_spikes`.

    Raises StageFault rate, stands-still or rows.
    """
    size = bench.geometry
    bench.write("sensor_run", 0)
    bench.write("sensor_pattern", 1)
    bench.write("sensor_level", _ELECTRONS)
    bench.write("sensor_rows", (size.rows - 1) << 16)
    bench.write("sensor_columns", (size.columns - 1) << 16)
    bench.write("sensor_tick_clocks", size.tick_clocks)
    rates: list[dict[str, object]] = []
    frames_run = 0
    for select in (0, 1):
        bench.write("sensor_clock_select", select)
        for rule in range(len(RULES)):
            bench.write("sensor_reset_rule", rule)
            for level in range(LEVELS):
                frames, spikes = _run(bench, level, select)
                each = count_spikes(frames, _ELECTRONS << select, level, rule)
                must = size.rows * size.columns * each % _WORD
                frames_run += frames
                rates.append({
                    "clock": select, "rule": RULES[rule], "level": level,
                    "rate": spikes / (size.rows * size.columns * frames),
                    "expected": each / frames,
                })  # fmt: skip
                if spikes != must:
                    raise StageFault(
                        "rate",
                        f"threshold level {level}, {20 if select else 40} kHz, {RULES[rule]} "
                        f"reset: {spikes} spikes in {frames} frames, where {must} are expected "
                        f"({rates[-1]['rate']:.4f} per pixel and tick instead of "
                        f"{rates[-1]['expected']:.4f})",
                        _remedy(size.rows * size.columns, spikes - must),
                        {"settings": len(rates), "electrons": _ELECTRONS, "rates": rates},
                    )
    bench.write("sensor_clock_select", 0)
    bench.write("sensor_reset_rule", 0)
    bench.write("sensor_threshold", 7)
    return {"settings": len(rates), "frames": frames_run, "spikes_wrong": 0,
            "electrons": _ELECTRONS, "rates": rates}  # fmt: skip


def _run(bench: Bench, level: int, select: int) -> tuple[int, int]:
    """Frames and spikes of a run that starts without charge, after the last frame is read."""
    bench.write("sensor_threshold", level)
    bench.write("sensor_clear", 1)
    before = bench.read_stable("sensor_frame_clock")
    bench.write("sensor_run", 1)
    patience = bench.ticks_s(_LEAST_FRAMES, select)
    limit = bench.limit(10 * patience + 2.0)
    # Until the first frame begins, the counters still hold the values of the previous run.
    while bench.read("sensor_frame_clock") == before or bench.read("sensor_frames") < _LEAST_FRAMES:
        if limit.left() <= 0:
            bench.write("sensor_run", 0)
            raise StageFault(
                "stands-still",
                f"the sensor began {bench.read('sensor_frames')} frames, not {_LEAST_FRAMES}",
                "check the scan's counter and the pixel clock",
            )
        bench.bone.pause(patience / 4)
    bench.write("sensor_run", 0)
    limit.restart()
    while True:
        frames = bench.read("sensor_frames")
        if frames < _LEAST_FRAMES:
            raise StageFault(
                "stands-still",
                f"the frame counter fell to {frames} after it had reached {_LEAST_FRAMES}",
                "check the sensor's supply and reset",
            )
        read = bench.read("sensor_rows_read")
        if read == frames * bench.geometry.rows % _WORD and frames == bench.read_stable(
            "sensor_frames"
        ):
            return frames, bench.read_stable("sensor_spikes")
        if limit.left() <= 0:
            raise StageFault(
                "rows",
                f"{read} rows were read in {frames} frames of {bench.geometry.rows}",
                "check the window and the row counter",
            )
        bench.bone.pause(bench.ticks_s(1, select))


def _remedy(pixels: int, excess: int) -> str:
    if excess % pixels:
        return "the pixels differ: the figure of captured planes shows which"
    return "check that threshold's value, the clock select and the reset rule in the pixel"


def count_spikes(frames: int, electrons: int, level: int, rule: int) -> int:
    """Spikes of one pixel that starts without charge.

    At most one spike a tick. With residual or subtracting reset, the charge beyond Q remains, so
    after n ticks the pixel has fired floor(n electrons / Q) times. With hard reset it fires every
    ceil(Q / electrons) ticks.

    Args:
        frames: number of ticks.
        electrons: electrons of one tick, 0 to 510; at 20 kHz twice those at 40 kHz.
        level: level of the threshold, Q = 255 + 256 level.
        rule: reset rule, 0 residual (also 3), 1 hard, 2 subtract.
    """
    q = 255 + 256 * level
    if electrons <= 0:
        return 0
    if electrons >= q:
        return frames
    return frames // -(-q // electrons) if rule == 1 else frames * electrons // q
