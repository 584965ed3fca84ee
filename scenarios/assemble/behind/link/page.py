"""The section of the report on the link: both ends side by side, and its cost."""

from __future__ import annotations

import html
from collections.abc import Callable
from dataclasses import replace

from cosim.config.amounts import amount, decibel, number, percent
from cosim.report.figures import sheet_figure
from cosim.report.parts import plot, table
from cosim.report.png import for_display
from cosim.run.machine import Page, Run
from link.plan.check import left_out_documents
from link.report.tables import left_out_table
from scenarios.assemble.behind.link.judged import StreamLinkOutcome
from scenarios.assemble.behind.link.rates import rates_figure

FIGURE = "figures/through-link.png"
RATES_FIGURE = "figures/rates.png"
_CROSSING = (
    "Before they are shown, the spikes cross a room as light: they are coded into packets, a panel "
    "flashes these, a second spike camera films the panel, and a receiver decodes the packets."
)
_RATES = ("stream_bps", "link_bps", "goodput_bps")


def stream_link_page(run: Run, page_of: Callable[[Run], Page]) -> Page:
    """The page of a machine with the sections of its link first; writes their figures.

    Args:
        run: the run; its views are a `StreamLinkOutcome`.
        page_of: the page of the machine, for the run with its own views.
    """
    views = run.outcome.views
    assert isinstance(views, StreamLinkOutcome)
    page = page_of(replace(run, outcome=replace(run.outcome, views=views.views)))
    sections = [_ends(run, views), _cost(run), _bits(run, views), _time(run, views), _plan(views)]
    files = [FIGURE]
    if views.rates:
        sections.append(_rates(run, views))
        files.append(RATES_FIGURE)
    return replace(
        page, simulated=f"{page.simulated} {_CROSSING}",
        sections=[*sections, *page.sections], files=[*page.files, *files],
    )  # fmt: skip


def _ends(run: Run, views: StreamLinkOutcome) -> str:
    clock = views.link.stream.clock
    heads = [f"{number(clock.middle(shot.cycle) / 1e9, 4)} ms" for shot in views.direct]
    rows = [
        ("TFP, sent", [for_display(shot.tfp) for shot in views.direct]),
        ("TFP, through the link", [for_display(shot.tfp) for shot in views.through]),
    ]
    if views.lit:
        rows.insert(0, ("true light", [for_display(shot.truth) for shot in views.direct]))
    path = run.folder / FIGURE
    sheet_figure(heads, rows, path)
    fidelity = views.fidelity[0].upper() + views.fidelity[1:]
    return (
        f"<h2>Both ends of the link</h2><p>{fidelity}. The stream of spikes was coded, sent by the "
        "panel, filmed by the link's chip and decoded. The images are those of the same instants "
        "of the stream.</p>" + plot(path, "images of both ends of the link at the same instants")
    )


def _rates(run: Run, views: StreamLinkOutcome) -> str:
    path = run.folder / RATES_FIGURE
    against = "the true light" if views.lit else "that of the stream sent"
    data = rates_figure(views.rates, against, path)
    return (
        "<h2>Picture against the rate of the link</h2><p>The middle of the picture was coded again "
        "with every code, at rates of the link that are stated for a megapixel: PSNR of TFP at "
        f"cycle {views.rated} (of median PSNR) against {against}, and the share of packets left "
        "out. Counts over a packet have less noise than a window of TFP, so still light may look "
        "better with fewer layers. Where the link carries less than the code makes, the layered "
        "code sends fewer layers, the others fewer tiles.</p>"
        + plot(path, "PSNR and packets left out against the rate of the link", data)
    )


def _value(run: Run, name: str) -> str:
    metric = run.result.metrics[name]
    return decibel(metric.value) if metric.unit == "dB" else amount(metric.value, metric.unit)


def _cost(run: Run) -> str:
    names = {
        "stream_bps": "the code makes", "link_bps": "the link can carry",
        "goodput_bps": "arrived in time", "code_bits_per_pixel_cycle": "a pixel and cycle, coded",
        "sent_bits_per_pixel_cycle": "a pixel and cycle, arrived",
        "psnr_direct": "image of the stream sent", "psnr_through_link": "image through the link",
        "dropped_spikes": "spikes not shown in their cycle",
        "added_spikes": "spikes shown that were not sent in that cycle",
        "packets_dropped": "packets not sent", "packets_late": "packets too late",
        "tiles_missing": "tiles shown without a packet",
        "buffer_peak_bytes": "largest content of the send buffer",
        "frames_lost": "frames of the link lost",
        "bytes_corrected": "bytes mended by the code of words",
    }  # fmt: skip
    rows = [[text, _value(run, name)] for name, text in names.items()]
    return "<h2>What the link cost</h2>" + table(["quantity", "value"], rows)


def _bits(run: Run, views: StreamLinkOutcome) -> str:
    setup, hz = views.link.setup, views.link.stream.clock.hz
    carried, arrived = setup.rate * hz, run.result.metrics["goodput_bps"].value
    spent = {name: bits * hz for name, bits in setup.spent().items()}
    whole = sum(spent.values()) + carried
    if arrived is not None:
        spent["packets that arrived in time"] = arrived
        spent["empty, lost, or late"] = max(carried - arrived, 0.0)
    rows = [
        [name, amount(bits, "bit/s"), percent(bits / whole)]
        for name, bits in [("all cells of the panel", whole), *spent.items()]
    ]
    return (
        "<h2>Where the bits of the panel go</h2><p>Between the training and the closing symbols; "
        "packets over the time of the stream.</p>" + table(["part", "rate", "share"], rows)
    )


def _time(run: Run, views: StreamLinkOutcome) -> str:
    rows = [
        [row.stage, *(amount(us * 1e-6, "s", 4) for us in (row.min_us, row.median_us, row.max_us))]
        for row in run.outcome.latency
    ]
    clock = views.link.stream.clock
    return (
        "<h2>From light to light</h2><p>Time in the simulated machine. A spike is shown "
        f"{amount(views.link.hold / clock.hz, 's', 4)} after its latch, whatever packet carries "
        "it.</p>" + table(["stage", "minimum", "median", "maximum"], rows)
    )


def _plan(views: StreamLinkOutcome) -> str:
    planned = views.link.planned
    rows = left_out_documents(planned.plan, planned.check)
    head = (
        "<p>Changes of the bit error rate, in half-widths of the 99.9 % interval of that rate over "
        "the bits of the run, as estimated and as measured on patches, with the 99.9 % interval. "
        "The patches have fewer bits: a single bit that differs there weighs more.</p>"
    )
    return (
        "<h2>What the simulation of the link left out</h2>"
        + (head if rows else "")
        + left_out_table(rows)
        + f"<p>Kept: {html.escape(', '.join(planned.plan.simulated))}.</p>"
    )
