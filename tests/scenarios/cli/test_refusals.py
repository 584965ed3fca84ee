"""Options that the parser refuses are refused in the words of the others."""

from __future__ import annotations

import pytest

from scenarios.cli.refusals import parser_refusal


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        (("board", "virtual", "--rows", "0"), "--rows must be at least 1, not '0'; see "),
        (("board", "virtual", "--rows=abc"), "--rows must be a whole number, not 'abc'; see "),
        (("view", "x", "--port", "99999"), "--port must be at most 65535, not '99999'; see "),
        (("board", "stream", "nope"),
         "SOURCE must be one of 'array', 'external', 'lines', not 'nope'; see "),
    ],
)  # fmt: skip
def test_a_value_that_the_parser_refuses(refused, arguments, says):
    assert refused(*arguments).startswith(says)


@pytest.mark.parametrize(
    ("group", "commands"),
    [
        ("link", "ber, capacity, send, receive"),
        ("design", "dynamic-range"),
        ("board", "identify, regs, prbs, bringup, capture, compare, stream, replay, virtual, "
         "gateware, links"),
    ],
)  # fmt: skip
def test_a_group_without_a_command_names_its_commands(refused, group, commands):
    assert refused(group) == (
        f"the command after `viform {group}` must be one of {commands}, not none; "
        f"see `viform {group} --help`"
    )


def test_other_texts_stay():
    for text in ("No such option: --x", "Invalid value for '--a': something else"):
        assert parser_refusal(text, ["--a", "1"]) == text
