"""The group of commands `viform design`."""

import typer

from scenarios.cli.design.dynamic_range import design_dynamic_range

design = typer.Typer(
    name="design",
    help="Choose hardware: dynamic range within a budget.",
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)


@design.callback()
def _group() -> None:
    """Without a callback, typer would replace a group of one command by this command."""


design.command("dynamic-range")(design_dynamic_range)
