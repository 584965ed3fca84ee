"""A run of a board: brought up, its pattern filmed, and the frames held against the cycle model."""

from __future__ import annotations

import time
from pathlib import Path

from cosim import InputError, Interrupted, Viform
from cosim.files.zarr_store import write_zarr
from cosim.run.chain import STREAM
from cosim.run.folder import begin_folder, claimed, mend, output_folder
from cosim.run.progress import Progress
from cosim.run.result import Metric, Result, Throughput, write_result
from rtl_model.bringup import STAGES, Report, Stage, bring_up
from rtl_model.bringup.frames import clock_of, compared, uploaded_image
from rtl_model.bringup.place import VIRTUAL, Opened, csr_of, opened
from rtl_model.bringup.report import write_board_report
from rtl_model.bringup.section import BoardSection
from rtl_model.bringup.waves import check_trace, write_waves
from rtl_model.geometry import Geometry
from rtl_model.host import Board, LineFault, Uartbone, open_port, pattern
from rtl_model.virtual import nominal_clock
from scenarios.assemble.schema.loading import to_toml
from scenarios.assemble.schema.scenario import BoardScenario

__all__ = ["run_board"]

_SIDE, _LANES = 32, 32  # of a virtual board whose size is not given
_MOST_WORDS = 1 << 20  # of a virtual board's capture memory
_ELECTRONS_LEVEL = 0  # threshold level under which the image is captured


def run_board(
    name: str,
    scenario: BoardScenario,
    out: Path | None,
    *,
    resume: bool = False,
    progress: Progress,
    began: float,
    trace: Path | None = None,
) -> tuple[Result, Path]:
    """Brings the board up, captures `board.frames` frames of an image, compares them, and writes
    the run's folder, `result.json` last. The outcome is "failed" where a stage fails or a bit is
    wrong; the report names which.

    resume: into a folder that an interrupted run has left; all stages are run again, since a board
        may have changed meanwhile. trace: waveforms of a virtual board, .fst or .vcd.
    Raises InputError for what cannot be used (nothing is written then), Interrupted.
    """
    section = scenario.board
    output_folder(name, out, resume)
    geometry = _virtual_geometry(section) if section.port == VIRTUAL else None
    check_trace(trace, geometry)
    known = csr_of(None if section.csr is None else Path(section.csr))
    place = opened(
        section.port, section.baud, section.time_scale,
        level=section.level if geometry is not None else "bytes",
        faults=list(section.faults), geometry=geometry,
    )  # fmt: skip
    done = 0
    with place as board, claimed(name, out, resume) as folder:
        begin_folder(folder, to_toml(scenario))
        try:
            progress.start("stages", len(STAGES) + 1)

            def told(stage: Stage) -> None:
                nonlocal done
                done += 1
                progress.advance(done)

            report = bring_up(
                board.url, baud=section.baud, csr=known, simulated=board.simulated,
                time_scale=board.time_scale, log=folder / "line.jsonl", progress=told,
                note=progress.note,
            )  # fmt: skip
            result = _result(name, scenario, report, board)
            fault = _film(result, report, scenario, board, folder) if report.ok else None
            progress.advance(len(STAGES) + 1)
            if trace is not None and geometry is not None:
                write_waves(trace, geometry, scenario.seed)
            result.files += write_board_report(report, folder, _notes(result, trace, fault))
            result.files.append("result.json")
            result.run_time_s = time.perf_counter() - began
            if fault is not None:
                progress.note(str(fault))
            if report.cause is not None:
                progress.note(f"stage {report.failed_stage}: {report.cause}")
            write_result(folder, result)
        except KeyboardInterrupt:
            raise Interrupted(done, len(STAGES), mend(folder), "stages") from None
    return result, folder


def _virtual_geometry(section: BoardSection) -> Geometry:
    """A build whose capture memory holds the frames. InputError for more than it may hold."""
    size = Geometry(
        section.rows or _SIDE, section.columns or _SIDE, section.lanes or _LANES,
        nominal_clock(section.level, section.baud), section.baud,
    )  # fmt: skip
    words = section.frames * size.rows * size.record_words
    if words > _MOST_WORDS:
        fit = _MOST_WORDS // (size.rows * size.record_words)
        raise InputError(
            "board.frames", f"at most {fit} of {size.rows} x {size.columns}, for which a board has "
            "memory", str(section.frames), "take fewer or a smaller board",
        )  # fmt: skip
    return size._replace(capture_words=max(size.capture_words, 1 << (words - 1).bit_length()))


def _result(name: str, scenario: BoardScenario, report: Report, board: Opened) -> Result:
    virtual = scenario.board.port == VIRTUAL
    device = f"virtual board, level {scenario.board.level}" if virtual else f"board at {board.url}"
    compared_bits = report.figure("patterns", "bits_compared")
    wrong = report.figure("patterns", "bits_wrong")
    passed = sum(stage.outcome == "ok" for stage in report.stages)
    return Result(
        scenario=name,
        outcome="ok" if report.ok else "failed",
        seed=scenario.seed,
        device=device,
        simulated_s=0.0,
        tolerance=0.0,
        metrics={
            "frames_compared": Metric(report.figure("patterns", "frames_compared") or 0, "1"),
            "bits_compared": Metric(compared_bits or 0, "1"),
            "bits_wrong": Metric(wrong, "1"),
            "round_trips_per_s": Metric(report.figure("counters", "round_trips_per_s"), "1/s"),
            "capture_bytes_per_s": Metric(report.figure("patterns", "capture_bytes_per_s"), "B/s"),
            "stages_passed": Metric(passed, "1"),
        },
        files=["scenario.toml", "line.jsonl"],
    )


def _film(
    result: Result, report: Report, scenario: BoardScenario, board: Opened, folder: Path
) -> LineFault | None:
    """Captures the image's frames into the folder's stream and adds them to the metrics. Returns
    what the line did, which fails the run: a board that passed may be gone a moment later."""
    try:
        _capture(result, report, scenario, board, folder)
    except LineFault as fault:
        result.outcome = "failed"
        return fault
    return None


def _capture(
    result: Result, report: Report, scenario: BoardScenario, board: Opened, folder: Path
) -> None:
    section = scenario.board
    port = open_port(board.url, section.baud)
    try:
        bone = Uartbone(port, baud=section.baud, time_scale=board.time_scale)
        csr = csr_of(None if section.csr is None else Path(section.csr))
        known = Board(bone, csr)
        size = known.info().geometry
        _check_size(section, size)
        for register, value in _settings(size).items():
            known.write(register, value)
        pattern.upload(known, uploaded_image(size, scenario.seed))
        taken, burst = compared(known, section.frames)
        clock = clock_of(known)
    finally:
        port.close()
    write_zarr(Viform.from_planes(taken.planes, clock), folder / STREAM)
    result.files.append(STREAM)
    result.simulated_s = section.frames / clock.hz
    report.bursts.append(burst)
    metrics = result.metrics
    wrong = 0 if burst.wrong is None else burst.wrong.bits
    counted = {"frames_compared": len(burst.got), "bits_compared": burst.got.size}
    for name, more in (counted | {"bits_wrong": wrong}).items():
        metrics[name] = Metric((metrics[name].value or 0) + more, "1")
    rate = taken.bytes / max(taken.seconds, 1e-9)
    metrics["capture_bytes_per_s"] = Metric(rate, "B/s")
    result.throughput.append(Throughput("capture", rate, "B/s"))
    if wrong:
        result.outcome = "failed"


def _settings(size: Geometry) -> dict[str, int]:
    """Registers under which the image is captured: all pixels, 40 kHz, nothing lost of a charge."""
    return {
        "sensor_threshold": _ELECTRONS_LEVEL,
        "sensor_clock_select": 0,
        "sensor_reset_rule": 0,
        "sensor_rows": (size.rows - 1) << 16,
        "sensor_columns": (size.columns - 1) << 16,
        "sensor_tick_clocks": size.tick_clocks,
        "sensor_pattern": 0,
        "capture_source": 0,
    }


def _check_size(section: BoardSection, size: Geometry) -> None:
    """InputError where the board is not of the size that was asked for, or holds too little."""
    for name in ("rows", "columns", "lanes"):
        asked, is_ = getattr(section, name), getattr(size, name)
        if asked is not None and asked != is_:
            raise InputError(
                f"board.{name}", f"{is_}, as the board has", str(asked), "leave it out, or load "
                "another build",
            )  # fmt: skip
    fit = size.capture_words // (size.rows * size.record_words)
    if section.frames > fit:
        raise InputError(
            "board.frames", f"at most {fit}, for which this board has memory", str(section.frames),
            "take fewer",
        )  # fmt: skip


def _notes(result: Result, trace: Path | None, fault: LineFault | None) -> list[str]:
    frames = result.metrics["frames_compared"].value or 0
    notes = [
        f"{frames:.0f} frames were compared with the cycle model, bit by bit; outcome "
        f"{result.outcome}"
    ]
    if fault is not None:
        notes.append(f"the image was not captured: {fault}")
    return notes if trace is None else [*notes, f"waveforms: {trace}"]
