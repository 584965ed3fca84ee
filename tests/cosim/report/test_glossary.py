"""Terms and their definitions."""

from __future__ import annotations

import re

import pytest

from cosim.report.glossary import TERMS, explained, terms_list


def words(body: str) -> list[str]:
    return re.findall(r"<dfn[^>]*>([^<]*)</dfn>", explained(body)[0])


def test_the_first_use_in_each_section_is_marked():
    body = "<p>TFP and TFP</p><h2>Next</h2><p>TFP</p>"
    text, terms = explained(body)
    assert words(body) == ["TFP", "TFP"]
    assert terms == {"TFP"}
    assert re.sub(r"</?dfn[^>]*>", "", text) == body


@pytest.mark.parametrize(
    ("text", "marked"),
    [
        ("Spikes fire", ["Spikes"]),
        ("two patches", ["patches"]),
        ("a TFPx, an XTFP, a-TFP-b", []),
        ("Full physics", ["Full physics"]),
        ("tolerances of an effect", ["tolerances", "effect"]),
        ("dn and rms are not terms", []),
        ("shot noise of the tier", ["shot noise", "tier"]),
    ],
)
def test_forms_of_a_term(text, marked):
    assert words(f"<p>{text}</p>") == marked


@pytest.mark.parametrize("tag", ["h2", "h3", "pre", "code", "td", "a", "button", "figcaption"])
def test_headings_code_and_cells_stay_as_they_are(tag):
    body = f"<{tag}>TFP</{tag}>"
    assert explained(body) == (body, set())


def test_attributes_stay_as_they_are_and_text_after_them_does_not():
    body = '<img alt="TFP" src="data:image/png;base64,TFP+TFI=="><p>TFI</p>'
    text, terms = explained(body)
    assert text.startswith(body[: body.index("<p>")]) and terms == {"TFI"}


def test_every_term_can_be_marked_and_is_listed_once():
    for term in TERMS:
        assert words(f"<p>{term}</p>") == [term]
    listed = re.findall(r"<dt>(.*?)</dt>", terms_list(TERMS))
    assert listed == sorted(TERMS, key=str.lower)


def test_definitions_are_sentences():
    for text in TERMS.values():
        assert text[0].isupper() and text.endswith(".") and len(text) < 200
