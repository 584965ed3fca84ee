"""A delivered name stays in its folder."""

from pathlib import PurePosixPath, PureWindowsPath

import pytest
from hypothesis import given
from hypothesis import strategies as st

from link.coding import safe_name


@pytest.mark.parametrize(
    ("given", "name"),
    [
        ("photo.jpg", "photo.jpg"),
        ("/etc/passwd", "passwd"),
        ("../../x.py", "x.py"),
        ("..\\..\\x.py", "x.py"),
        ("..", "file"),
        (".", "file"),
        ("", "file"),
        ("a/", "file"),
        ("C:x", "C_x"),
        ("con.txt", "filecon.txt"),
        ("a\x00b\n\u202egpj.exe", "a_b__gpj.exe"),
        ("照片.jpg", "照片.jpg"),
        ("x" * 300 + ".tar", "x" * 116 + ".tar"),
    ],
)
def test_names(given, name):
    assert safe_name(given) == name


@given(st.text(max_size=400))
def test_any_text_is_one_part_of_a_path(text):
    name = safe_name(text)
    assert 0 < len(name.encode()) <= 120
    assert name not in (".", "..") and name.isprintable()
    assert PurePosixPath(name).parts == (name,) and PureWindowsPath(name).parts == (name,)
    assert safe_name(name) == name
