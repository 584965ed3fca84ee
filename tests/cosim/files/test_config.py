"""config.yaml: content of public sets, size of frames, refused content; never overwritten."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from cosim import InputError
from cosim.files import open_stream, write_stream
from cosim.files.config_yaml import Config, adjacent_config, read_config, recording_of, write_config

PUBLIC = """filename: BSS
spike_w: 8
spike_h: 3
is_labeled: false
labeled_data_type: [7]
labeled_data_suffix: None
"""
LABELED = """filename: a
spike_w: 8
spike_h: 3
is_labeled: true
labeled_data_type: [1, 3.1]
labeled_data_suffix: npy
data_field_identifier: 'input'
label_field_identifier: 'gt'
"""
MEND = "correct it, or give the recording itself with its --size WxH"


@pytest.fixture
def folder(tmp_path: Path, random_stream) -> Path:
    """A folder with the recording a.dat, 8 x 3 pixels."""
    write_stream(random_stream(), tmp_path / "a.dat")
    return tmp_path


def config(folder: Path, text: str) -> Path:
    path = folder / "config.yaml"
    path.write_text(text)
    return path


@pytest.mark.parametrize(("text", "name"), [(PUBLIC, "BSS"), (LABELED, "a")])
def test_the_keys_of_public_sets_are_read(folder: Path, text: str, name: str) -> None:
    assert read_config(config(folder, text)) == Config(name, (8, 3))


@pytest.mark.parametrize("text", [PUBLIC, LABELED, LABELED.replace(": a\n", ": sub/a.dat\n")])
@pytest.mark.parametrize("given", ["a.dat", "", "config.yaml"])
def test_the_size_comes_from_beside(folder: Path, random_stream, text: str, given: str) -> None:
    config(folder, text)
    stream = open_stream(folder / given)
    assert (stream.shape, stream.cycles) == ((3, 8), 75)
    np.testing.assert_array_equal(stream.read_words(0, 3), random_stream().words)


def test_a_config_of_another_recording_or_program_says_nothing(folder: Path) -> None:
    (folder / "b.dat").write_bytes(bytes(12_500))
    config(folder, LABELED)
    assert adjacent_config(folder / "b.dat") is None
    assert open_stream(folder / "b.dat").shape == (250, 400)
    for text in ("learning_rate: 0.1\n", "- 1\n- 2\n", "", "just a text"):
        config(folder, text)
        assert adjacent_config(folder / "a.dat") is None


def test_a_config_that_names_nothing_stands_for_the_only_recording(folder: Path) -> None:
    path = config(folder, PUBLIC)
    assert recording_of(folder)[0] == folder / "a.dat"
    (folder / "b.dat").write_bytes(bytes(3))
    for opened in (folder, path):
        with pytest.raises(InputError) as refused:
            open_stream(opened)
        assert str(refused.value) == (
            f"{folder} must be a folder with the recording 'BSS' that its config.yaml names, not "
            "one with 2 others; give the recording itself"
        )


@pytest.mark.parametrize(
    "name", ["../a", "/etc/passwd", "nul\\0", "x" * 5000, "..", "/", "\\uD800"]
)
def test_a_filename_cannot_lead_out_of_its_folder(folder: Path, name: str) -> None:
    inner = folder / "inner"
    inner.mkdir()
    path = config(inner, f'filename: "{name}"\nspike_w: 8\nspike_h: 3\n')
    with pytest.raises(InputError) as refused:
        open_stream(path)
    assert str(refused.value).isascii()
    (inner / "b.dat").write_bytes(bytes(3))
    assert open_stream(inner / "b.dat").shape == (3, 8)


def test_a_length_against_the_config_names_it(folder: Path) -> None:
    config(folder, PUBLIC.replace("8", "16"))
    with pytest.raises(InputError, match=r"6 bytes \(16x3\), as its config.yaml says, not 225"):
        open_stream(folder / "a.dat")


@pytest.mark.parametrize(
    ("text", "given"),
    [
        ("filename: a\nspike_w: 8\n", "one whose spike_h is None"),
        ("filename: a\nspike_w: '8'\nspike_h: 3\n", "one whose spike_w is '8'"),
        ("filename: a\nspike_w: true\nspike_h: 3\n", "one whose spike_w is True"),
        ("filename: a\nspike_w: 8.0\nspike_h: 3\n", "one whose spike_w is 8.0"),
        ("filename: a\nspike_w: 0\nspike_h: 3\n", "one whose spike_w is 0"),
        ("filename: a\nspike_w: -8\nspike_h: 3\n", "one whose spike_w is -8"),
        ("filename: a\nspike_w: [8]\nspike_h: 3\n", "one whose spike_w is a list"),
        ("filename: a\nspike_w: 99999\nspike_h: 99999\n", "one of 99999x99999 pixels"),
        ("filename: 7\nspike_w: 8\nspike_h: 3\n", "one whose filename is 7"),
        ("spike_w: 8\nspike_h: 3\n", "one whose filename is None"),
        (PUBLIC.replace("false", "2"), "one whose is_labeled is 2"),
        (PUBLIC.replace("[7]", "[seven]"), "one whose labeled_data_type is a list"),
        (PUBLIC.replace("None", "3"), "one whose labeled_data_suffix is 3"),
        (LABELED.replace("'gt'", "{a: 1}"), "one whose label_field_identifier is a dict"),
        ("filename: [\n", "broken in line 2 ("),
        ("spike_w: 8\n\tspike_h: 3", "broken in line 2 ("),
        ("filename: !!python/object/apply:os.getcwd []\nspike_w: 8", "broken in line 1 ("),
        ("spike_w: 2024-13-45", "broken (month must be in 1..12)"),
        ("spike_w: " + "[" * 100, "broken in line 1 ("),
        ("spike_w: " + "9" * 5000, "broken ("),
        ("a" * 2**13 + "a", "more than 8192 bytes"),
        ("spike_w: " + "[" * 101, "one of more than 100 lists and mappings"),
    ],
)  # fmt: skip
def test_a_bad_config_is_one_line(folder: Path, text: str, given: str) -> None:
    path = config(folder, text)
    says = f"{path} must be YAML with filename, spike_w and spike_h, not {given}"
    for opened in (folder / "a.dat", path):
        with pytest.raises(InputError) as refused:
            open_stream(opened)
        assert str(refused.value).startswith(says)
        assert str(refused.value).endswith(MEND)
        assert len(str(refused.value)) < 1000
    assert open_stream(folder / "a.dat", (8, 3)).cycles == 75


def test_aliases_that_multiply_cost_nothing(folder: Path) -> None:
    lines = ["a0: &a0 [x, x]"]
    lines += [f"a{n}: &a{n} [*a{n - 1}, *a{n - 1}]" for n in range(1, 60)]
    path = config(folder, "\n".join([*lines, "spike_h: *a59", "spike_w: 8", "filename: a"]))
    with pytest.raises(InputError, match="whose spike_h is a list"):
        read_config(path)


def test_what_is_written_is_read_and_is_what_others_expect(folder: Path) -> None:
    write_config(folder / "a.dat", (8, 3))
    assert yaml.safe_load((folder / "config.yaml").read_text()) == {
        "filename": "a", "spike_w": 8, "spike_h": 3, "is_labeled": False,
        "labeled_data_type": [0], "labeled_data_suffix": "None",
    }  # fmt: skip
    assert adjacent_config(folder / "a.dat") == Config("a", (8, 3))


@pytest.mark.parametrize("name", ["yes", "1e3", "null", "a: b", "- x", "#", "öäü", "'", "*a"])
def test_any_name_can_be_written(tmp_path: Path, random_stream, name: str) -> None:
    write_stream(random_stream(), tmp_path / f"{name}.dat", config=True)
    assert open_stream(tmp_path).cycles == 75
    assert read_config(tmp_path / "config.yaml") == Config(name, (8, 3))


@pytest.mark.parametrize(
    ("text", "given"),
    [
        (PUBLIC.replace("8", "16"), "one that says 16x3"),
        ("learning_rate: 0.1\n", "another"),
        ("filename: [\n", "another"),
        ("filename: b\nspike_w: 8\nspike_h: 3\n", "another"),
    ],
)
def test_a_config_that_is_there_is_never_overwritten(
    tmp_path: Path, random_stream, text: str, given: str
) -> None:
    path = config(tmp_path, text)
    (tmp_path / "b.dat").touch()
    with pytest.raises(InputError) as refused:
        write_stream(random_stream(), tmp_path / "a.dat", config=True)
    assert str(refused.value) == (
        f"{path} must be absent, or one that says 8x3 of a.dat, not {given}; "
        "write into another folder"
    )
    assert path.read_text() == text
    assert sorted(p.name for p in tmp_path.iterdir()) == ["b.dat", "config.yaml"]


def test_one_that_says_the_same_stays_as_it_is(tmp_path: Path, random_stream) -> None:
    path = config(tmp_path, PUBLIC)
    assert write_stream(random_stream(), tmp_path / "a.dat", config=True) == []
    assert path.read_text() == PUBLIC


def test_one_that_contradicts_what_was_written_is_said(tmp_path: Path, random_stream) -> None:
    config(tmp_path, PUBLIC.replace("8", "16"))
    path = tmp_path / "a.dat"
    assert write_stream(random_stream(), path) == [
        f"{path} does not keep its size and the config.yaml beside it says 16x3: read it with "
        "--size 8x3"
    ]


@settings(max_examples=80)
@given(data=st.data())
def test_damage_is_refused_or_harmless(tmp_path_factory, damage, data: st.DataObject) -> None:
    path = tmp_path_factory.mktemp("config") / "config.yaml"
    path.write_bytes(damage(data, LABELED.encode()))
    try:
        found = read_config(path)
    except InputError as exc:
        assert len(str(exc).splitlines()) == 1
        return
    assert found.filename and min(found.size) > 0


@given(st.binary(max_size=200) | st.text(alphabet="[]{}:-,&*!|>'\"\n \tab01", max_size=60))
def test_random_text_is_refused(tmp_path_factory, content: bytes | str) -> None:
    path = tmp_path_factory.mktemp("config") / "config.yaml"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(InputError):
        read_config(path)
