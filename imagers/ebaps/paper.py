"""Document 002: a home-made imaging circuit for an electron-bombarded CMOS sensor (EBAPS)."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from cosim.clock import PS
from cosim.run.printed import PrintedRow, listed, number, unprinted
from imagers.ebaps.board.adc_lines import AdcLines
from imagers.ebaps.board.axi import region_offset
from imagers.ebaps.board.cameralink import (
    LINK_HZ,
    WORD_BITS,
    LinkTiming,
    deserialise,
    serialise,
)
from imagers.ebaps.board.timing import CLOCK_HZ, LIVE, REGIONS, Timing, region_bytes
from imagers.ebaps.device.drive import DRIVES, drive_records
from imagers.ebaps.device.exposure import (
    DARKS,
    DEFAULT_EXPOSURE,
    SHORTEST_EXPOSURE,
    STEP,
    WINDOW,
    ExposureRule,
    Linear,
    follow,
)
from imagers.ebaps.device.sequencer import DESIGN, HIGH_VOLTAGE
from imagers.ebaps.device.settling import settle, settling_exposure
from imagers.ebaps.pixels import (
    PHOTOCATHODES,
    Chart,
    EbapsPixels,
    contrast_to_noise,
    recognisable,
    smallest_bar,
)
from sensor.frame_pixels import Exposed

_NAMES = {name.lower() for name in DRIVES}


def ebaps_rows() -> list[PrintedRow]:
    """Every number in order."""
    return [*_chip(), *_link(), *_exposure(), *_loop(), *_memory(), *_board(), *_night()]


def _reset(name: str) -> int:
    return int(next(r.reset for r in DESIGN.specific if r.name == f"ebaps_{name}"))


def _bright_frame() -> npt.NDArray[np.uint16]:
    """A frame of the sensor in far too much light, without noise."""
    pixels = EbapsPixels()
    rows = pixels.shape[0]
    light = Exposed(np.full(pixels.shape, 1e6), np.full(rows, 1e-2), np.zeros(rows), 0, 0)
    return pixels.convert(light, 1, frozenset())


def _chip() -> list[PrintedRow]:
    timing, pixels, frame = Timing(), EbapsPixels(), _bright_frame()
    fast = Timing(clock_hz=80_000_000, rate=60)
    height, width = frame.shape
    records = drive_records([(0, DEFAULT_EXPOSURE), (1, DEFAULT_EXPOSURE), (2, DEFAULT_EXPOSURE)])
    falls = [r.ps for r in records if r.signal == "vsync" and r.value == 0]
    per_second = (len(falls) - 1) * PS / (falls[-1] - falls[0])
    bright, _ = pixels.mean_variance(1e-6, 1e-3)
    dark, _ = EbapsPixels(volts=0.0).mean_variance(1e-6, 1e-3)
    return [
        listed("002 §1", "columns and rows", [1280, 1024], [width, height], "pixels",
               note="of a simulated frame", by="component"),
        number("002 §1", "pixel clock at the most", "80", fast.readout_clocks * 60 * 1e-6, "MHz",
               relation="<=", note="60 frames/s would still fit into it; what pixels take",
               by="constant"),
        number("002 §3.1", "pixel clock", "40", CLOCK_HZ * 1e-6, "MHz", by="constant"),
        number("002 §1", "frames a second", "30", per_second, "1/s",
               note=f"of VSYNC's falling edges in the waveforms; {100 * timing.blanking:.1f} % are "
               "blank", by="component"),
        number("002 §2", "bits of a value", "16", int(frame.max()).bit_length(), "bit",
               note="of the largest value of a simulated frame", by="component"),
        number("002 §2", "samples a second of the converter", "80e6", CLOCK_HZ, "1/s",
               relation="<=", note="what the pixel clock asks of it; its 80 MS/s allow twice that",
               by="constant"),
        number("002 §3", "parallel digital lines of the converter", "16", _aligned_lines(),
               note="whose training finds an eye, at 80 MS/s", by="component"),
        listed("002 §1", "working band, um", [0.3, 0.97], _band(), "um",
               note="where the photocathode's assumed curve is above 0", by="constant"),
        listed("002 §5", "high voltage, volts", [0, 1500],
               [_least_volts(pixels), HIGH_VOLTAGE], "V",
               note=f"gain {pixels.tube.gain(1500):.0f} at 1500 V, {pixels.tube.gain(0):.0f} at 0: "
               f"{bright:.0f} and {dark:.0f} DN", by="constant"),
    ]  # fmt: skip


def _aligned_lines() -> int:
    found = AdcLines(50.0, 1000.0).train(1)
    return int(np.count_nonzero(found.eyes))


def _band() -> list[float]:
    """Ends of the response of a GaAs photocathode, um, to a nanometre."""
    nm = np.arange(250.0, 1100.0)
    there = nm[PHOTOCATHODES["GaAs"].efficiency(nm) > 0]
    return [float(there[0] - 1) / 1000, float(there[-1] + 1) / 1000]


def _least_volts(pixels: EbapsPixels) -> int:
    """The largest voltage that drives no photoelectron across."""
    return max(v for v in range(3) if pixels.tube.gain(float(v)) == 0.0)


def _link() -> list[PrintedRow]:
    """Drive signals, and the Camera Link output."""
    timing, words = LinkTiming(), np.array([0x5A5A5A5, (1 << WORD_BITS) - 1, 0], np.uint32)
    made = serialise(words)
    frames = timing.clock_hz / (timing.line_clocks * timing.rows)
    back = deserialise(made)
    full = deserialise(serialise(np.array([0xFFFFFFFF], np.uint32)))
    channels, places = made.shape
    return [
        number("002 §1", "drive signals of the sensor", "9",
               len({r[1] for r in drive_records([(0, DEFAULT_EXPOSURE)])} & _NAMES),
               note="those that a frame's waveforms hold: " + ", ".join(DRIVES), by="component"),
        number("002 §2", "parallel bits of a Camera Link word", "28",
               int(full[0]).bit_count() if np.array_equal(back, words) else 0, "bit",
               note="that the serial channels carry, and are read back the same", by="component"),
        number("002 §2", "serial channels", "5", channels,
               note=f"four of {places // words.size} bits a clock and the clock's own",
               by="component"),
        number("002 §2", "clock of the link", "85", LINK_HZ * 1e-6, "MHz",
               note=f"pixels take {100 * timing.utilisation:.1f} % of its clocks; "
               f"{timing.pair_rate * 1e-6:.0f} Mbit/s on a pair, "
               f"{timing.bits_per_second * 1e-9:.2f} Gbit/s in all", by="constant"),
        number("002 §0", "frames a second that the link's lines allow", "30", frames, "1/s",
               note="1280 x 1024, lines of whole clocks", by="formula"),
        listed("002 §2", "clock range of the link's chip, least and most", [True, True],
               [LINK_HZ >= 10e6, LINK_HZ <= 90e6],
               note="10 to 90 MHz, as printed, hold the 85 MHz", by="constant"),
    ]  # fmt: skip


def _exposure() -> list[PrintedRow]:
    timing, rule = Timing(), ExposureRule()
    first = follow(rule, lambda *_: 24_800, 1)[0]
    bottom = follow(rule, lambda *_: 65_535, 200)[-1]
    top = follow(rule, lambda *_: 0, 200)[-1]
    steps = np.abs(np.diff(follow(rule, lambda *_: 65_535, 20)))
    return [
        number("002 eq. 3", "T_max = m n / f", "32768000", timing.longest_exposure, "ns",
               by="formula"),
        number("002 §3.1", "T_max, where the loop stops in the dark", "32768000", top, "ns",
               by="component"),
        number("002 §3.1", "T_min, where it stops in bright light", "1000000", bottom, "ns",
               by="component"),
        number("002 §3.1", "T_default, where it begins", "16384000", first, "ns", by="component"),
        number("002 §3.1", "step", "640000", int(steps.max()), "ns", by="component"),
        number("002 §3.1", "T_min, its register", "1000000", _reset("shortest"), "ns",
               note=f"{SHORTEST_EXPOSURE} ns", by="constant"),
        listed("002 §3.1", "window of the mean", [24_000, 25_600], _window(rule), "DN",
               note="least and most mean that the loop leaves as it is", by="component"),
    ]  # fmt: skip


def _window(rule: ExposureRule) -> list[int]:
    """The means, DN, at which the rule keeps the exposure."""
    still = [m for m in range(1 << 16) if rule.after(DEFAULT_EXPOSURE, m, 1) == DEFAULT_EXPOSURE]
    return [still[0], still[-1]]


def _loop() -> list[PrintedRow]:
    """Consequences of the fixed step, which the document does not print."""
    rule = ExposureRule()
    limit = float(settling_exposure(rule)) * 1e-6
    middle = float(settling_exposure(rule, sum(WINDOW) // 2)) * 1e-6
    kinds = [settle(rule, Linear.wanting(round(ms * 1e6), rule)).kind for ms in (20, 10, 2.1)]
    return [
        unprinted("002 §3.1", "shortest exposure from which a step is sure to meet the window",
                  limit, "ms", holds=abs((limit + STEP * 1e-6) / limit - WINDOW[1] / WINDOW[0])
                  < 1e-9, note=f"for shorter ones a fixed step of {STEP} ns hunts or meets it by "
                  f"chance; {middle:.2f} ms in terms of the window's middle", by="formula"),
        listed("002 fig. 6 and 7", "the loop rests from below (20 ms) and above (10 ms)",
               ["rest", "rest"], kinds[:2],
               note=f"where 2.1 ms are wanted it ends in a {kinds[2]}", by="component"),
    ]  # fmt: skip


def _memory() -> list[PrintedRow]:
    made, frame = region_bytes(), _bright_frame()
    return [
        number("002 §3.2", "regions in memory", "5", REGIONS, by="constant"),
        number("002 §3.2", "of them dark frames", "4", LIVE, note=f"a mean of {DARKS}",
               by="constant"),
        number("002 §3.2", "bytes of a region, 1280 x 1024 x 2", str(1280 * 1024 * 2),
               frame.nbytes, "B", proof=None if made == frame.nbytes else False,
               note="of a simulated frame", by="component"),
        number("002 §3.2", "bytes from the base to the live frame's region",
               str(4 * 1280 * 1024 * 2), region_offset(LIVE), "B",
               note="address = base + region's offset + running burst", by="formula"),
        number("002 §3.2", "bytes of a value", "2", frame.nbytes / frame.size, "B",
               note="of a simulated frame", by="component"),
    ]  # fmt: skip


def _board() -> list[PrintedRow]:
    dynamic, static = 1.185, 0.076
    return [
        number("002 §5", "power of the logic: dynamic 1.185 W and static 0.076 W", "1.261",
               dynamic + static, "W", note="the sum of the printed parts; no power is simulated",
               by="constant"),
        number("002 §5", "power of the whole board", "4.8", dynamic + static, "W", relation="<=",
               note="the logic's share of it", by="constant"),
    ]  # fmt: skip


def _night() -> list[PrintedRow]:
    """Figure 11 by the contrast-to-noise ratio of a chart's bar and Rose's threshold of 5."""
    longest = Timing().longest_exposure * 1e-9
    night, still = EbapsPixels(volts=1500.0), EbapsPixels(volts=0.0)
    rows = []
    for lux, pixels, seen in ((3e-3, night, True), (3e-1, still, False)):
        chart = Chart(lux)
        ratio = contrast_to_noise(pixels, chart, longest)
        bar = smallest_bar(pixels, chart, longest)
        text = "none that fits" if bar is None else f"{bar:.1f} pixels"
        rows.append(listed(
            "002 fig. 11", f"recognisable at {lux:g} lx with {-pixels.volts + 0.0:g} V", [seen],
            [recognisable(pixels, chart, longest)],
            note=f"contrast to noise {ratio:.3g} of a bar of 6 x 30 pixels (Rose: 5 is seen); "
            f"smallest bar {text}; f/1.4 assumed", by="formula",
        ))  # fmt: skip
    return rows
