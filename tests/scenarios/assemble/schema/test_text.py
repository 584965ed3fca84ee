"""Files of text as editors of users write them: with byte-order marks, and in UTF-16."""

from __future__ import annotations

from pathlib import Path

import pytest

from cosim import InputError
from cosim.config.toml import read_text
from cosim.files.config_yaml import read_config
from rtl_model.geometry import Geometry
from rtl_model.host.csr import read_csr
from rtl_model.registers import csr_csv
from scenarios.assemble.schema.loading import load
from scenarios.studies.dataset.inputs import read_cameras
from scenarios.studies.design.document import load_budget
from sensor.sections.preset_file import with_preset

ENCODINGS = ["utf-8-sig", "utf-16"]
"""Those of Notepad, and of a redirection in PowerShell."""
SCENARIO = """
title = "Öl"
duration = "1 ms"
[scene]
kind = "film"
illuminance = "700 lux"
[sensor]
threshold = "1000 e"
""".replace("\n", "\r\n")


@pytest.mark.parametrize("encoding", ENCODINGS)
def test_files_of_text_may_begin_with_a_byte_order_mark(tmp_path: Path, encoding: str) -> None:
    def written(name: str, text: str) -> Path:
        (tmp_path / name).write_bytes(text.encode(encoding))
        return tmp_path / name

    _, scenario = load(str(written("a.toml", SCENARIO)))
    assert scenario.title == "Öl"
    (camera,) = read_cameras([str(written("b.toml", '[sensor]\nchip = "spikeone"\n'))])
    assert camera.section == {"chip": "spikeone"}
    assert load_budget(str(written("c.toml", ""))) == load_budget(None)
    preset = written("p.toml", '[sensor]\nthreshold = "900 e"\n')
    assert with_preset({"preset": str(preset)}, 1)["threshold"] == "900 e"
    table = csr_csv(Geometry())
    (tmp_path / "plain.csv").write_text(table)
    assert read_csr(written("d.csv", table)).registers == read_csr(tmp_path / "plain.csv").registers
    config = written("config.yaml", "filename: a.dat\nspike_w: 8\nspike_h: 4\n")
    assert read_config(config).size == (8, 4)


def test_text_of_another_encoding_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_bytes(SCENARIO.encode("latin-1"))
    with pytest.raises(InputError, match=r"the scenario must be a TOML file, not .*decode"):
        load(str(tmp_path / "a.toml"))
    for content in (b"", b"\xff", b"\xfe\xff", b"\xef\xbb"):
        (tmp_path / "a.txt").write_bytes(content)
        try:
            assert read_text(tmp_path / "a.txt") == ""
        except ValueError:
            assert content in (b"\xff", b"\xef\xbb")
