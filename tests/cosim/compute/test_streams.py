"""Random streams: each has a number of its own, which is defined only in the table."""

from __future__ import annotations

import ast
from pathlib import Path

import numpy as np

from cosim.compute.philox import philox4x32
from cosim.compute.philox_compiled import word_at
from cosim.compute.streams import Stream
from sensor.latched.effects import EFFECTS

ROOT = Path(__file__).parents[3]


def test_streams_are_distinct_and_keep_their_numbers():
    numbers = {name: int(stream) for name, stream in Stream.__members__.items()}
    assert len(set(numbers.values())) == len(numbers)
    assert numbers == {
        "NONE": 0, "SHOT_NOISE": 1, "INITIAL_CHARGE": 2, "METASTABILITY": 3, "CHARGE": 4,
        "ROW_TIMING": 5, "DRIFT": 6, "CALL": 7,
        "PATTERN": 16,
        "SKIPPED": 48, "READING": 49, "CONTINUOUS": 64,
        "VIBRATION": 80,
        "SCINTILLATION": 81,
        "SERIAL_NOISE": 96,
        "IMAGER_SHOT": 112, "IMAGER_DARK": 113, "IMAGER_READ": 114, "IMAGER_RESET": 115,
        "IMAGER_GAIN": 116, "IMAGER_LOSS": 117, "IMAGER_CLOCKS": 118, "IMAGER_IONS": 119,
        "IMAGER_SPREAD": 120, "IMAGER_PATTERN": 121, "IMAGER_THERMAL": 122,
        "IMAGER_LINES": 123, "IMAGER_WHITE": 124, "IMAGER_TRANSFER": 125,
        "IMAGER_CIRCUIT": 126,
    }  # fmt: skip
    assert all(0 <= number < 2**32 for number in numbers.values())


def test_every_file_that_draws_names_its_stream_by_the_table():
    draws = {"random_words", "word_at", "philox4x32"}
    found = 0
    for path in [*(ROOT / "sensor").rglob("*.py"), *(ROOT / "scenarios").rglob("*.py")]:
        tree = ast.parse(path.read_text())
        calls = [
            node for node in ast.walk(tree)
            if isinstance(node, ast.Call) and getattr(node.func, "id", "") in draws
        ]  # fmt: skip
        for call in calls:
            last = call.args[-1]
            key = last.elts[-1] if isinstance(last, ast.Tuple) else last
            assert not isinstance(key, ast.Constant), f"{path}:{call.lineno}"
        if calls:
            found += 1
            # By the table, or by that of an effect which has it from there.
            text = path.read_text()
            assert (
                "from cosim.compute.streams import Stream" in text or "SHOT_NOISE.stream" in text
            ), path
    assert found >= 6
    assert all(isinstance(effect.stream, Stream) for effect in EFFECTS.values())


def test_word_at_is_the_words_of_its_counters_one_after_another():
    seed, draw, pixel = 5, 3, 77
    for first in (0, 2**34 - 4, 2**36 + 8):
        block = first >> 2
        words = philox4x32(
            (pixel, block >> 32, block & 0xFFFFFFFF, draw), (seed, Stream.CONTINUOUS)
        )
        ours = [
            word_at(*(np.uint64(x) for x in (pixel, first + i, draw, seed, Stream.CONTINUOUS)))
            for i in range(4)
        ]
        assert ours == [int(word) for word in words]
