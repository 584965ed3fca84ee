"""The files that a scenario names: told by their content in a run's folder, and known again."""

from __future__ import annotations

import hashlib
import os
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from cosim.config.toml import to_toml
from cosim.run.folder import begin_folder
from cosim.run.inputs import add_digests, changed_files, digest
from imagers.run.chain import FrameChain
from scenarios.assemble.schema.loading import load


@pytest.fixture
def sent(tmp_path: Path) -> Path:
    path = tmp_path / "letter.txt"
    path.write_bytes(b"of many words")
    return path


def scenario(sent: Path, name: str = "light-link", key: str = "link.file") -> Any:
    return load(name, [f"{key}={sent}"])[1]


def test_a_file_is_told_by_its_content_and_a_change_of_it_is_seen(sent):
    text = to_toml(scenario(sent))
    seal = add_digests(text)
    told = hashlib.sha256(b"of many words").hexdigest()
    assert seal == f"# link.file: sha256 {told}\n{text}"
    assert changed_files(seal) == [] == changed_files(text)
    os.utime(sent, (1, 1))
    assert changed_files(seal) == []
    sent.write_bytes(b"of other word")  # as long as before
    assert changed_files(seal) == [("link.file", str(sent))]
    sent.unlink()
    assert changed_files(seal) == [] and digest(sent) is None and add_digests(text) == text


def test_a_title_is_no_seal(sent):
    text = to_toml(scenario(sent).model_copy(update={"title": f"\n# link.file: sha256 {64 * '0'}"}))
    assert changed_files(text) == []


def test_a_run_s_folder_holds_a_scenario_that_can_be_run_again(sent, tmp_path):
    asked = scenario(sent)
    begin_folder(tmp_path, to_toml(asked))
    text = (tmp_path / "scenario.toml").read_text(encoding="utf-8")
    assert text.startswith("# link.file: sha256 ")
    assert load(str(tmp_path / "scenario.toml"))[1] == asked


def test_an_imager_s_tape_is_of_one_clip(sent):
    spec = SimpleNamespace(toml=to_toml(scenario(sent, "ebaps-night", "scene.path")), seed=1)
    planned: Any = SimpleNamespace(
        kept=frozenset(), spec=spec, pixels=SimpleNamespace(effects={}),
        exposures=SimpleNamespace(frames=1),
    )  # fmt: skip
    chain = FrameChain(planned, sent.parent)
    before = chain._identity()
    assert chain._identity() == before
    sent.write_bytes(b"of others")
    assert chain._identity() != before
