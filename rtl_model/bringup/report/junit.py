"""The bring-up as JUnit XML for build servers, with one test case for each stage."""

from __future__ import annotations

import xml.etree.ElementTree as xml
from pathlib import Path

from cosim.files.whole import whole
from rtl_model.bringup.bench.stage import Report

# Characters that XML 1.0 forbids, even as entities.
_CONTROLS = [*range(9), 11, 12, *range(14, 32), 0xFFFE, 0xFFFF]
_FORBIDDEN = dict.fromkeys([*_CONTROLS, *range(0xD800, 0xE000)], "?")


def junit_xml(report: Report) -> str:
    """The text of the document. The figures of a stage are the properties of its test case."""
    failed = sum(stage.outcome == "failed" for stage in report.stages)
    skipped = sum(stage.outcome == "left out" for stage in report.stages)
    spent = sum(stage.seconds for stage in report.stages)
    suite = xml.Element(
        "testsuite",
        name="viform.board.bringup",
        tests=str(len(report.stages)),
        failures=str(failed),
        errors="0",
        skipped=str(skipped),
        time=f"{spent:.6f}",
    )
    for stage in report.stages:
        case = xml.SubElement(
            suite,
            "testcase",
            classname="viform.board",
            name=stage.name,
            time=f"{stage.seconds:.6f}",
        )
        if stage.figures:
            properties = xml.SubElement(case, "properties")
            for name, value in stage.figures.items():
                xml.SubElement(properties, "property", name=name, value=_clean(str(value)))
        cause = _clean(stage.cause or "")
        if stage.outcome == "failed":
            failure = xml.SubElement(case, "failure", message=cause, type=stage.kind or "fault")
            failure.text = cause
        elif stage.outcome == "left out":
            xml.SubElement(case, "skipped", message=cause)
    suites = xml.Element("testsuites")
    suites.append(suite)
    xml.indent(suites)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + xml.tostring(suites, "unicode") + "\n"


def write_junit(report: Report, path: Path) -> None:
    """Writes the document atomically."""
    with whole(path) as part:
        part.write_text(junit_xml(report), encoding="utf-8")


def _clean(text: str) -> str:
    return text.translate(_FORBIDDEN)
