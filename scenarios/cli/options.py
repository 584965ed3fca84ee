"""Options that several commands share."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from dataclasses import dataclass, fields, is_dataclass
from typing import TYPE_CHECKING, Annotated, Any, get_type_hints

import typer

if TYPE_CHECKING:
    from pathlib import Path

    from scenarios.assemble.schema.scenario import AnyScenario

ScenarioName = Annotated[
    str, typer.Argument(help="a name from `viform list`, a TOML file, or the folder of a run")
]
Tolerance = Annotated[float | None, typer.Option(help="allowed relative error")]
Draws = Annotated[
    str | None,
    typer.Option(
        metavar="each|bank",
        help="each: the draws of full physics; bank: other noise of the same law, faster [bank]",
    ),
]
Resume = Annotated[bool, typer.Option("--resume", help="continue what was interrupted in --out")]
Workers = Annotated[int | None, typer.Option(help="processes on this machine [one for two cores]")]
Scheduler = Annotated[
    str | None, typer.Option(help="address of a Dask scheduler, for its workers instead")
]
Device = Annotated[
    str | None,
    typer.Option(help="number of an OpenCL device (`viform doctor`), part of its name, or numba"),
]


def check_figure(figure: Path | None, *endings: str, option: str = "--figure") -> None:
    """Raises InputError for a figure that could not be written once it is computed.

    Args:
        figure: file of the option; None if absent.
        endings: endings of names that can be drawn, the preferred one first; `.png` if none is
            given.
        option: its name.
    """
    from cosim import InputError

    endings = endings or (".png",)
    if figure is None:
        return
    if figure.suffix.lower() not in endings:
        must = f"a name ending in {' or '.join(endings)}"
        raise InputError(
            option, must, str(figure),
            f"try {figure.with_suffix(endings[0]) if figure.name else figure / 'figure.png'}",
        )  # fmt: skip
    if not figure.absolute().parent.is_dir():
        raise InputError(option, "in a folder that exists", str(figure), "create the folder")


def count_workers(given: int | None) -> int:
    """Number of processes for --workers; None for one for two cores, which a run uses. Raises
    InputError."""
    from cosim.compute.cores import cores
    from cosim.run.workers import check_workers

    check_workers(given)
    return given or max(cores() // 2, 1)


@dataclass(frozen=True)
class ScenarioOptions:
    """Keys of a scenario that the command line overrides, and the device of the simulation."""

    assignments: Annotated[
        list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="override a key")
    ] = None
    seed: Annotated[int | None, typer.Option(help="seed of all temporal noise")] = None
    device: Device = None

    def load(
        self, scenario: str, tolerance: float | None = None, draws: str | None = None
    ) -> tuple[str, AnyScenario]:
        """Short name and checked scenario. Raises InputError."""
        # Importing the schema takes half a second; `--help` does not need it.
        from scenarios.assemble.schema.loading import load

        return load(scenario, self.assignments, tolerance=tolerance, seed=self.seed, draws=draws)


def expand_options(command: Callable[..., None]) -> Callable[..., None]:
    """Decorator for a command with dataclasses as parameters.

    Each field of such a dataclass becomes an option of the command line, with the annotation of the
    field.
    """
    records: dict[str, Any] = {}
    parameters: list[inspect.Parameter] = []
    for parameter in inspect.signature(command, eval_str=True).parameters.values():
        record = parameter.annotation
        if not is_dataclass(record):
            parameters.append(parameter.replace(kind=inspect.Parameter.KEYWORD_ONLY))
            continue
        records[parameter.name] = record
        hints = get_type_hints(record, include_extras=True)
        parameters += [
            inspect.Parameter(
                field.name,
                inspect.Parameter.KEYWORD_ONLY,
                default=field.default,
                annotation=hints[field.name],
            )
            for field in fields(record)
        ]

    def expanded(**values: Any) -> None:
        arguments: dict[str, Any] = {
            name: record(**{field.name: values.pop(field.name) for field in fields(record)})
            for name, record in records.items()
        }
        command(**arguments, **values)

    expanded.__name__, expanded.__doc__ = command.__name__, command.__doc__
    expanded.__signature__ = inspect.Signature(parameters)  # type: ignore[attr-defined]
    expanded.__annotations__ = {each.name: each.annotation for each in parameters}
    return expanded
