"""`viform link`: error-rate curves, capacity, and files through recordings of a link."""

import typer

from scenarios.cli.link.ber import link_ber
from scenarios.cli.link.capacity import link_capacity
from scenarios.cli.link.receive import link_receive
from scenarios.cli.link.send import link_send

link = typer.Typer(
    name="link",
    help="Bytes over light: error rates beside theory, capacity, files through streams.",
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
link.command("ber")(link_ber)
link.command("capacity")(link_capacity)
link.command("send")(link_send)
link.command("receive")(link_receive)
