"""The exceptions: one line with the requirement, the actual value and the remedy."""

from __future__ import annotations

import pickle

import pytest

from cosim.errors import InputError, Interrupted, ViformError

ERRORS = [
    InputError("sensor.clock", "a frequency such as '40 kHz'", "'40 lux'", "write it in Hz"),
    Interrupted(128, 2560, "go on with --resume"),
]


def test_the_text_says_must_given_and_mend() -> None:
    assert [str(error) for error in ERRORS] == [
        "sensor.clock must be a frequency such as '40 kHz', not '40 lux'; write it in Hz",
        "interrupted after 128 of 2560 cycles; go on with --resume",
    ]


@pytest.mark.parametrize("given", ["two\nlines", "a\ttab", "\r\n", "a\u2028b", "a\x85b", "a\vb"])
def test_the_text_is_one_line_whatever_was_given(given: str) -> None:
    text = str(InputError("x", "y", given, "mend\nit"))
    assert len(text.splitlines()) == 1
    assert text.startswith("x must be y, not ")
    assert text.endswith("; mend it")


@pytest.mark.parametrize("error", ERRORS, ids=lambda e: type(e).__name__)
def test_errors_are_of_one_family_and_reach_other_processes(error: ViformError) -> None:
    assert isinstance(error, ViformError)
    again = pickle.loads(pickle.dumps(error))
    assert type(again) is type(error)
    assert str(again) == str(error)
    assert vars(again) == vars(error)
