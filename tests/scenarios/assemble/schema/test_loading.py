"""From a name or a file and --set to a scenario: where paths count from, and that nothing else than
a scenario or one line comes out."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from cosim import InputError
from cosim.config.toml import to_toml
from cosim.errors import quote
from scenarios.assemble.schema.loading import load, shipped
from scenarios.assemble.schema.scenario import AnyScenario

FILM = shipped()["film"]


def refusal(name: str, *assignments: str) -> str:
    with pytest.raises(InputError) as caught:
        load(name, list(assignments))
    return str(caught.value)


@pytest.mark.parametrize("name", sorted(shipped()))
def test_a_shipped_scenario_loads_by_name_and_from_what_it_is_written_as(name, tmp_path):
    short, scenario = load(name)
    assert short == name
    (tmp_path / "again.toml").write_text(to_toml(scenario), encoding="utf-8")
    assert load(str(tmp_path / "again.toml")) == ("again", scenario)


def test_the_folder_of_a_run_stands_for_the_scenario_in_it(tmp_path):
    folder = tmp_path / "star-1"
    folder.mkdir()
    (folder / "scenario.toml").write_text(shipped()["star"], encoding="utf-8")
    assert load(str(folder)) == ("star-1", load("star")[1])
    assert load(str(folder / "scenario.toml"))[0] == "star-1"


def test_set_overrides_what_the_file_says_and_the_last_one_wins():
    _, scenario = load("film", ["duration=1 ms", "sensor.chip=spikeone", "duration=2 ms"])
    assert (scenario.duration, scenario.sensor.chip) == (0.002, "spikeone")


def test_set_creates_sections_that_are_absent():
    _, scenario = load("film", ["sensor.lens.f_number=2.8", "image.window=21"])
    assert (scenario.sensor.lens.f_number, scenario.image.window) == (2.8, 21)


def test_set_reads_lists_as_json():
    assert load("film", ["image.at=[3, 1, 2]"])[1].image.at == (3, 1, 2)
    assert load("film", ["image.at=[]"])[1].image.at == ()


def test_a_value_may_hold_equals_signs_and_blanks_around_the_key_do_not_count():
    assert load("film", ["title=a=b"])[1].title == "a=b"
    assert load("film", [" title =a"])[1].title == "a"


def test_the_options_of_seed_and_tolerance_come_last():
    _, scenario = load("film", ["seed=3", "tolerance=0.5"], seed=7, tolerance=0.25)
    assert (scenario.seed, scenario.tolerance) == (7, 0.25)


@pytest.mark.parametrize(
    ("assignment", "said"),
    [
        ("title", "--set must be KEY=VALUE such as sensor.clock='20 kHz', not 'title'; add it"),
        ("=3", "--set must be KEY=VALUE such as sensor.clock='20 kHz', not '=3'; add it"),
        ("a..b=3", "--set must be KEY=VALUE such as sensor.clock='20 kHz', not 'a..b=3'; add it"),
        ("", "--set must be KEY=VALUE such as sensor.clock='20 kHz', not ''; add it"),
        ("title.x=3",
         "--set title.x must be a key of a section, which title is, not below a value; "
         "set title itself"),
        ("image.at=[1,",
         "image.at must be a list such as [100, 200], not '[1,'; "
         "write --set image.at='[100, 200]'"),
    ],
)  # fmt: skip
def test_a_wrong_assignment_is_told_what_to_write(assignment, said):
    assert refusal("film", assignment) == said


def test_a_path_counts_from_the_file_in_toml_and_from_here_in_set(tmp_path, monkeypatch):
    (tmp_path / "files").mkdir()
    (tmp_path / "here").mkdir()
    text = FILM.replace('kind = "film"', 'kind = "film"\npath = "clip.mp4"')
    (tmp_path / "files" / "mine.toml").write_text(text, encoding="utf-8")
    monkeypatch.chdir(tmp_path / "here")
    relative = os.path.join("..", "files", "mine.toml")
    assert load(relative)[1].scene.path == str(tmp_path / "files" / "clip.mp4")
    set_here = load(relative, ["scene.path=clip.mp4"])[1].scene.path
    assert set_here == str(tmp_path / "here" / "clip.mp4")
    absolute = load(relative, [f"scene.path={tmp_path}/a.mp4"])[1].scene.path
    assert absolute == str(tmp_path / "a.mp4")


def test_the_resolved_scenario_finds_its_clip_from_anywhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    _, scenario = load("film", ["scene.path=clip.mp4"])
    (tmp_path / "sub").mkdir()
    written = tmp_path / "sub" / "scenario.toml"
    written.write_text(to_toml(scenario), encoding="utf-8")
    assert load(str(written))[1] == scenario


@pytest.mark.parametrize("name", ["nosuch", "nosuch.toml", "x" * 300, "a\0b", "", "."])
def test_what_is_no_scenario_is_refused_with_the_names_of_those_that_are(
    name, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    assert refusal(name) == (
        f"the scenario must be one of {', '.join(shipped())} or a TOML file, not {quote(name)}; "
        "see `viform list`"
    )


@pytest.mark.parametrize(
    "content",
    [
        b"title = ",
        b"\xff\xfe\0",  # half a character of UTF-16
        b"[scene",
        b"a = 1\na = 2",
        b"a = " + b"1" * 5000,
        b"a=" + b"[" * 3000,
    ],
)
def test_a_file_that_is_not_toml_is_refused_by_name(content, tmp_path):
    path = tmp_path / "bad.toml"
    path.write_bytes(content)
    said = refusal(str(path))
    assert said.startswith(f"the scenario must be a TOML file, not {path} (")
    assert said.endswith("; correct that place")


@pytest.mark.parametrize("path", ["a\0b", "x" * 300, ""])
def test_a_path_that_cannot_be_one_makes_a_line_or_waits_for_the_clip(path):
    try:
        scenario = load("film", [f"scene.path={path}"])[1]
    except InputError as exc:
        assert str(exc).startswith("scene.path must be")
    else:
        assert Path(scenario.scene.path).is_absolute()


def scenario_or_line(name: str, assignments: list[str]) -> None:
    """Passes for a scenario and for one line that refuses it; any other exception fails."""
    try:
        _, scenario = load(name, assignments)
    except InputError as exc:
        assert "\n" not in str(exc)
        assert " must be " in str(exc)
    else:
        assert isinstance(scenario, AnyScenario)


KEYS = st.sampled_from(
    ["title", "duration", "seed", "tolerance", "scene", "scene.kind", "scene.path", "scene.start",
     "scene.illuminance", "sensor.clock", "sensor.lens", "sensor.lens.f_number", "image.at",
     "image.window", "image", "sensor.threshold.x", "scene.kind.y"]
)  # fmt: skip
VALUES = st.one_of(
    st.text(),
    st.text("0123456789eE+-. kMmuHzlux/nbdy*()[]{}_\"',"),
    st.sampled_from(["[]", "[[]]", "{}", "nan", "inf s", "-0 s", "1e400 Hz", "1e-400 e", "True",
                     "٣ ms", "1 ms # x", "\ud800", "1__0 s", "0x10 Hz", "[1e999]", "[NaN]"]),
)  # fmt: skip


@settings(max_examples=200)
@given(st.lists(st.one_of(st.text(), st.builds("{}={}".format, KEYS, VALUES)), max_size=3))
@example(["image.at=" + "[" * 100_000])
@example(["image.at=[" + "1" * 5000 + "]"])
@example(["seed=" + "1" * 5000])
@example(["scene.illuminance=" + "1" * 5000 + " lux"])
@example(["title=\ud800"])
def test_any_set_gives_a_scenario_or_one_line(assignments):
    scenario_or_line("film", assignments)


@settings(max_examples=80)
@given(st.data())
def test_any_toml_gives_a_scenario_or_one_line(tmp_path_factory, data):
    text = data.draw(st.sampled_from(sorted(shipped().values())))
    start = data.draw(st.integers(0, len(text)))
    stop = data.draw(st.integers(start, min(start + 40, len(text))))
    inserted = data.draw(
        st.one_of(st.text(st.characters(codec="utf-8"), max_size=12),
                  st.sampled_from(["1979-05-27", "0x1F", "-inf", "nan", "true", "{}", "[]", "[1]",
                                   '"""x"""', "[scene.x]\n", "[[scene]]\n", "scene = 1\n"]))
    )  # fmt: skip
    path = tmp_path_factory.getbasetemp() / "fuzz.toml"
    path.write_bytes((text[:start] + inserted + text[stop:]).encode())
    scenario_or_line(str(path), [])


@pytest.mark.parametrize("levels", [30, 3000, 20_000])
@pytest.mark.parametrize("form", ["[{}]\nb = 1", "title = 1\n{} = 1", "scene = {{{} = 1}}"])
def test_a_key_of_many_parts_is_one_line(form, levels, tmp_path):
    path = tmp_path / "deep.toml"
    path.write_text(form.format(".".join(["a"] * levels)))
    with pytest.raises(InputError, match="a key of more than 20 parts"):
        load(str(path))


def test_a_message_repeats_little_of_what_was_wrong(tmp_path):
    for text in ("scene." + "x" * 5000 + "=1", "y" * 5000, "scene.kind=" + "z" * 5000,
                 "scene." + ".".join("a" * 3000) + "=1"):  # fmt: skip
        with pytest.raises(InputError) as refused:
            load("film", [text])
        assert len(str(refused.value)) <= 400
    with pytest.raises(InputError) as refused:
        load("film", ["see\x1bd=1"])
    assert str(refused.value).isprintable()


FORMER = """
title = "A film"
duration = "2 ms"
[scene]
kind = "step"
illuminance = "700 lux"
[sensor]
threshold = "1000 e"
readout = "{}"
"""


@pytest.mark.parametrize(
    ("former", "kind"),
    [("synchronous", "latched"), ("asynchronous", "asynchronous"), ("continuous", "continuous")],
)
def test_the_former_name_of_a_kind_of_pixel_is_read(former: str, kind: str, tmp_path: Path) -> None:
    path = tmp_path / "film.toml"
    path.write_text(FORMER.format(former), encoding="utf-8")
    assert load(str(path))[1].sensor.pixel == kind
    assert load("step", [f"sensor.readout={former}"])[1].sensor.pixel == kind
    # The later word holds, whichever name it has.
    assert load(str(path), ["sensor.pixel=latched"])[1].sensor.pixel == "latched"
    named = ["sensor.pixel=asynchronous", f"sensor.readout={former}"]
    assert load("step", named)[1].sensor.pixel == kind


def test_a_kind_of_pixel_has_one_name_in_a_file(tmp_path: Path) -> None:
    path = tmp_path / "film.toml"
    path.write_text(FORMER.format("continuous") + 'pixel = "latched"\n', encoding="utf-8")
    with pytest.raises(InputError, match=r"sensor\.readout"):
        load(str(path))
