"""Document 001: CMOS image sensor with wide dynamic range and adaptive exposure."""

from __future__ import annotations

import math

import numpy as np

from cosim import PS
from cosim.run.printed import PrintedRow, listed, number, turning_point, unprinted
from imagers.adaptive.device.decision import (
    HALF_SCALE,
    MULTIPLIER_BITS,
    PRINTED_MULTIPLIER_BITS,
    Search,
    decide,
    lengthening,
    shortened,
)
from imagers.adaptive.device.imager import latency
from imagers.adaptive.device.loop import (
    brightest_lux,
    combined_response,
    exponential_deviation,
    from_judged,
    light_for,
    longest_exposure,
    search_path,
    settled,
    shortest_exposure,
)
from imagers.adaptive.device.registers import DEFAULT_LONGEST, DESIGN
from imagers.adaptive.device.signals import toggles
from imagers.adaptive.device.timing import CLOCK_HZ, FRAME_RATE, MINIMUM_CLOCKS, Timing, frames_of
from imagers.adaptive.pixels import BITS, CmosSetting

_SETTING = CmosSetting()
_TABLE = (("128-255", 255, 1), ("64-127", 64, 2), ("32-63", 32, 4), ("16-31", 16, 8),
          ("8-15", 8, 16), ("4-7", 4, 32), ("2-3", 2, 64), ("1", 1, 128))  # fmt: skip
"""Table 1, of which only the text survives: (range of values, one of them, factor)."""


def adaptive_rows() -> list[PrintedRow]:
    """The rows of `viform paper`, in the order of the document."""
    return [*_light(), *_decision(), *_searches(), *_registers(), *_sequence(), *_response()]


def _light() -> list[PrintedRow]:
    """Exposures at which the loop rests, and the least and most light that they measure."""
    rule, unit = from_judged(Search.HALF), shortest_exposure()
    shortest, longest = (
        settled(lux, rule, start=start).multiplier * unit
        for lux, start in ((1e9, 1 << DEFAULT_LONGEST), (0.0, 1))
    )
    brightest = turning_point(lambda lux: _SETTING.value(lux, shortest)[1], 1e3, 1e9)
    darkest = turning_point(lambda lux: _SETTING.value(lux, longest)[0] >= 1, 1e-6, 1e3)
    half = turning_point(lambda lux: _SETTING.value(lux, shortest)[0] >= HALF_SCALE, 1e3, 1e9)
    value, _ = _SETTING.value(0.1, longest)
    return [
        number("001 abstract", "shortest exposure", "1", shortest * 1e6, "us",
               note="where the loop rests in far too much light", by="component"),
        number("001 abstract", "longest exposure", "65", longest * 1e3, "ms",
               note="2^16 T, where the loop rests in the dark", by="component"),
        number("001 §1", "response", "1.0", HALF_SCALE * _SETTING.lsb / (half * shortest),
               "V/(lx s)", note="from the light that gives half of the scale", by="component"),
        number("001 abstract", "brightest light", "1e6", brightest, "lx",
               note="above it the shortest exposure saturates; a full scale of 1 V is assumed",
               by="component"),
        number("001 abstract", "darkest light", "1e-1", darkest, "lx", relation="<=",
               note=f"one DN at the longest exposure; 0.1 lx gives {value} DN", by="component"),
        number("001 abstract", "light range of 1e-1 to 1e6 lux in powers of ten", "7",
               math.log10(brightest / darkest), relation=">=", by="component"),
        number("001 §3.1", "value above which a pixel is saturated", "255",
               _SETTING.value(brightest_lux(), shortest)[0], "DN",
               note="not yet saturated at exactly full scale", by="component"),
    ]  # fmt: skip


def _decision() -> list[PrintedRow]:
    factors = [lengthening(value) for _, value, _ in _TABLE]
    fall = 256
    once = decide(1, 0, _SETTING.value(light_for(1) / fall, shortest_exposure())[0],
                  threshold=0, search=Search.PART).multiplier  # fmt: skip
    return [
        listed("001 table 1", "factor for largest values " + ", ".join(t for t, *_ in _TABLE),
               [f for *_, f in _TABLE], factors,
               note="the table is lost; its text fixes both ends", by="component"),
        number("001 §2", "least value that keeps the exposure: half of the scale", "128",
               min(v for v in range(256) if lengthening(v) == 1), "DN", by="component"),
        number("001 §2", "fall of light that one frame follows, power of two", "8",
               math.log2(once), note="light that rises that far saturates: the searches' case",
               by="component"),
        number("001 §2", "frames for light of 1/2 to 1/256 LSB", "2", _dim(), "frames",
               note="a value of 0 must ask for x256, one step beyond the table's x128",
               by="component"),
    ]  # fmt: skip


def _dim() -> int:
    """Largest number of decisions until the value reaches half scale, from a value of 0: for light
    that gives 1/2 to 1/256 LSB at the first exposure."""
    unit, most = shortest_exposure(), 0
    for part in (2, 4, 64, 256):
        lux = _SETTING.lsb / part / _SETTING.volts(1.0, unit) * (1 + 1e-6)
        multiplier, frames = 1, 0
        while True:
            value, over = _SETTING.value(lux, multiplier * unit)
            if over or value >= HALF_SCALE:
                break
            decision = decide(multiplier, 0, value, threshold=0, search=Search.PART)
            multiplier, frames = decision.multiplier, frames + 1
        most = max(most, frames)
    return most


def _searches() -> list[PrintedRow]:
    counts = [len(search_path(search)) - 1 for search in Search]
    start = 1 << 16
    span = light_for(1 << 3) / light_for(1 << 24)
    return [
        listed("001 §2", "exposure after saturation at 2^16 T: t/256, root, t/2",
               [1 << 8, 1 << 8, 1 << 15], [shortened(start, s) for s in Search], "T",
               by="component"),
        listed("001 §2", "frames of the three searches from 2^24 T to 2^3 T", [4, 3, 21], counts,
               "frames", note="one a decision; by the clock a decision shows two frames later",
               by="component"),
        number("001 §2", "light of that search, 1e0 to 1e6 lux, in powers of ten", "6",
               math.log10(span), note=f"2^21 = {span:.3g}", by="formula"),
    ]  # fmt: skip


def _registers() -> list[PrintedRow]:
    least = next(r for r in DESIGN.specific if r.name == "adaptive_minimum")
    register = next(r for r in DESIGN.specific if r.name == "adaptive_user")
    needed = max(search_path(Search.HALF)).bit_length()
    seconds = (1 << 24) * shortest_exposure()
    return [
        number("001 §3.3", "bits of the minimum-exposure register", "8", least.width, "bit",
               by="constant"),
        number("001 §3.3", "its value for 1 us at 20 MHz (14H)", "20", int(least.reset), "clocks",
               note=f"{MINIMUM_CLOCKS} clocks of {CLOCK_HZ / 1e6:g} MHz", by="constant"),
        number("001 §3.3", "bits of the multiplier register", "24", register.width, "bit",
               proof=needed == MULTIPLIER_BITS == PRINTED_MULTIPLIER_BITS + 1,
               note="the document's error: the search of section 2 starts at 2^24 T, a number of "
               f"{needed} bits ({seconds:.1f} s); {register.width} are used", by="constant"),
        number("001 §3.3", "values below half scale, each of which a table would hold", "128",
               sum(lengthening(v) > 1 for v in range(1 << BITS)), by="component"),
        number("001 §3.3", "bits of the table that powers of two save (128 x 8)", "1024",
               sum(lengthening(v) > 1 for v in range(1 << BITS)) * least.width, "bit",
               note="8 bits an entry, as the minimum-exposure register has", by="component"),
    ]  # fmt: skip


def _sequence() -> list[PrintedRow]:
    """Sections 4, 4.1 and 5 on a small array at 100 frames/s."""
    timing = Timing.of(4, 4)
    frames = frames_of(timing, [2000, 40_000, 20, 150_000, 2000, 2000])
    end = frames[-1].start + timing.deciding
    clocks, bits = toggles(timing, frames, 0, end)
    saved = 1 - int(bits.sum()) / int(toggles(timing, frames, 0, end, "binary")[1].sum())
    samples = {f.sample(row) for f in frames for row in range(timing.rows)}
    quiet = [s - n for s in samples for n in range(1, timing.cycle - timing.work + 1)]
    whole = {f.period - f.hold - f.exposure for f in frames}
    most = _latest(timing)
    long = round(longest_exposure() * CLOCK_HZ)
    short_rate, rate = (
        CLOCK_HZ / (pair[1].start - pair[0].start)
        for pair in (frames_of(timing, [exposure] * 3)[1:] for exposure in (20, long))
    )
    both = {f.counter for f in frames}
    return [
        listed("001 §4", "bits that a step of a counter changes", [1], sorted({*bits.tolist()}),
               "bit", note="all steps of all counters in six frames", by="component"),
        unprinted("001 §4", "toggles of binary counters that Gray code saves", 100 * saved, "%",
                  holds=saved > 0, note="the document says that there are fewer; a binary counter "
                  "of n bits toggles 2 - 2^(1-n) a step", by="component"),
        number("001 §4", "steps of counters in the idle phase that ends with a sample", "0",
               int(np.isin(clocks, quiet).sum()), by="component"),
        number("001 §4.2", "reset counters in turn", "2", len(both), by="component"),
        listed("001 §4.1", "frame time less hold less exposure", [0], sorted(whole), "clocks",
               by="component"),
        number("001 §4.1", "frames from N to the first with the new exposure, at the latest", "3",
               most, "frames", note="on the sensor: 36 instants, exposures, falls of light",
               by="component"),
        number("001 §5", "frames a second", "100", short_rate, "1/s",
               note="between two samples of the sequence", by="component"),
        number("001 §5", "frames a second at an exposure of 65 ms", "100", rate, "1/s",
               proof=longest_exposure() > 1 / FRAME_RATE,
               note="the document's error: 65 ms do not fit into the 10 ms of a frame; a frame of "
               f"a long exposure is longer, which is used: {rate:.1f} frames/s", by="component"),
    ]  # fmt: skip


def _latest(timing: Timing) -> int:
    """Largest number of frames from the last with the old light to the first with a new exposure,
    for light that falls by 2.2 to 200 at twelve instants of a frame."""
    frame, most = PS // FRAME_RATE, 0
    for exponent in (3, 12, 13):
        for phase in range(12):
            before = light_for(1 << exponent)
            change = 6 * frame + phase * frame // 12
            after = before / (2.2, 20.0, 200.0)[phase % 3]
            measured = latency(timing, change, before, after, multiplier=1 << exponent)
            most = max(most, measured.recorded - measured.changed)
    return most


def _response() -> list[PrintedRow]:
    lux = [light_for(1 << 16) * 2 ** (n / 8) for n in range(40)]
    points = combined_response(lux)
    ends = [p.exponent for p in points]
    deviation = exponential_deviation(points)
    return [
        number("001 fig. 6", "exposure of 2^16 T", "65", longest_exposure(max(ends)) * 1e3, "ms",
               by="component"),
        number("001 fig. 6", "exposure of 2^12 T", "4", longest_exposure(12) * 1e3, "ms",
               note=f"where the loop rests: from 2^{max(ends)} to 2^{min(ends)} T", by="formula"),
        unprinted("001 fig. 6", "how far the combined response is off an exponential",
                  100 * deviation, "%", holds=deviation <= 0.05,
                  note="the document says close to one, here taken for 5 %; straight lines "
                  "between octaves are 3 % off", by="component"),
    ]  # fmt: skip
