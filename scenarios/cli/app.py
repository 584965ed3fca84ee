"""The commands by name. A command imports its libraries when it runs, so that the command line
starts fast."""

import typer as _typer

from scenarios.cli.board.bringup import board_bringup, board_replay
from scenarios.cli.board.capture import board_capture
from scenarios.cli.board.compare import board_compare, board_stream
from scenarios.cli.board.gateware import board_gateware, board_links
from scenarios.cli.board.line import board_identify, board_prbs, board_regs
from scenarios.cli.board.virtual import board_virtual
from scenarios.cli.link.files import link_receive, link_send
from scenarios.cli.link.theory import link_ber, link_capacity
from scenarios.cli.maintenance.doctor import doctor as _doctor
from scenarios.cli.maintenance.test import test as _test
from scenarios.cli.scenario.listing import list_scenarios as _list
from scenarios.cli.scenario.live import live as _live
from scenarios.cli.scenario.plan import accuracy as _accuracy
from scenarios.cli.scenario.plan import plan as _plan
from scenarios.cli.scenario.run import run as _run
from scenarios.cli.scenario.view import view as _view
from scenarios.cli.stream.convert import convert as _convert
from scenarios.cli.stream.image import image as _image
from scenarios.cli.study.batch import dataset as _dataset
from scenarios.cli.study.batch import sweep as _sweep
from scenarios.cli.study.bench import bench as _bench
from scenarios.cli.study.calibrate import calibrate as _calibrate
from scenarios.cli.study.compare import compare as _compare
from scenarios.cli.study.compare import compare_methods as _compare_methods
from scenarios.cli.study.compare import compare_tracking as _compare_tracking
from scenarios.cli.study.design import design as _design
from scenarios.cli.study.laboratory import laboratory as _laboratory
from scenarios.cli.study.references import paper as _paper
from scenarios.cli.study.references import stability as _stability

_link = _typer.Typer(
    name="link",
    help="Bytes over light: error rates beside theory, capacity, files through streams.",
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
_link.command("ber")(link_ber)
_link.command("capacity")(link_capacity)
_link.command("send")(link_send)
_link.command("receive")(link_receive)

_board = _typer.Typer(
    name="board",
    help="A test board over a serial line or Ethernet: real, or of Verilog in a simulator.",
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
_board.command("identify")(board_identify)
_board.command("regs")(board_regs)
_board.command("prbs")(board_prbs)
_board.command("bringup")(board_bringup)
_board.command("capture")(board_capture)
_board.command("compare")(board_compare)
_board.command("stream")(board_stream)
_board.command("replay")(board_replay)
_board.command("virtual")(board_virtual)
_board.command("gateware")(board_gateware)
_board.command("links")(board_links)

app = _typer.Typer(
    name="viform",
    help="Simulate a 40 kHz megapixel spike camera, its display and an optical link.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
)
app.command("run")(_run)
app.command("list")(_list)
app.command("plan")(_plan)
app.command("accuracy")(_accuracy)
app.command("live")(_live)
app.command("view")(_view)
app.command("image")(_image)
app.command("reconstruct")(_image)
app.command("convert")(_convert)
app.add_typer(_link, name="link")
app.add_typer(_board, name="board")
app.add_typer(_design, name="design")
app.command("bench")(_bench)
app.command("compare")(_compare)
app.command("compare-methods")(_compare_methods)
app.command("compare-tracking")(_compare_tracking)
app.command("calibrate")(_calibrate)
app.command("laboratory")(_laboratory)
app.command("stability")(_stability)
app.command("paper")(_paper)
app.command("sweep")(_sweep)
app.command("dataset")(_dataset)
app.command("doctor")(_doctor)
# All arguments after `test` are passed to pytest.
_PASS_ON = {"ignore_unknown_options": True, "allow_extra_args": True}
app.command("test", context_settings=_PASS_ON)(_test)
