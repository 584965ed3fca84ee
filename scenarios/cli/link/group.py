"""`viform link`: error-rate curves, capacity, and files through recordings of a link."""

import typer

from scenarios.cli.link.files import link_receive, link_send
from scenarios.cli.link.theory import link_ber, link_capacity

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
