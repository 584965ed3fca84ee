"""The summary at the top of a page."""

from __future__ import annotations

import re

from cosim.report.summary import big, listed, paragraph, summary


def test_questions_stand_in_order_and_those_without_an_answer_are_left_out():
    answers = [
        ("What <was> done", paragraph("a < b")),
        ("How good", ""),
        ("How long", big("3 s", "")),
    ]
    made = summary("A & B", "one <line>", answers)
    assert re.findall(r"<dt>(.*?)</dt>", made) == ["What &lt;was&gt; done", "How long"]
    assert "<dd><p>a &lt; b</p></dd>" in made and "<h1>A &amp; B</h1>" in made
    assert "one &lt;line&gt;." in made and "outcome" not in made


def test_an_outcome_stands_above_the_answers():
    made = summary("A", "b", [("c", "<p>d</p>")], outcome="<b>Stage one failed</b>")
    assert made.index("Stage one failed") < made.index("<dl")


def test_lists_of_lines():
    assert listed(["a & b", "c"]) == "<ul><li>a &amp; b</li><li>c</li></ul>"
    assert listed([]) == paragraph("") == ""
