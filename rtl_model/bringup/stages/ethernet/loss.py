"""Stage loss: counts packets that are lost, repeated or reordered, in each direction."""

from __future__ import annotations

from cosim.config.amounts import number
from rtl_model.bringup.bench.bench import UdpBench
from rtl_model.bringup.bench.stage import Figures, StageFault
from rtl_model.host.ether import count_losses

_PACKETS = 512
_MOST = 0.1
"""Largest share of lost packets: then half of all windows of seven packets have a loss."""


def check_loss(bench: UdpBench) -> Figures:
    """Sends packets without repeating any, and compares the counts at both ends.

    Raises StageFault version for a board without numbered writes, loss if more than 10 % are lost.
    """
    if "write_mem" not in bench.csr.memories:
        raise StageFault(
            "version", "the design has no numbered writes (write_mem)",
            "load a board of this program's version",
        )  # fmt: skip
    counts, to_board, from_board = count_losses(bench.bone, _PACKETS)
    share = counts.lost / max(1, counts.sent)
    figures: Figures = {
        "packets": counts.sent, "packets_lost": counts.lost, "loss_percent": 100 * share,
        "packets_late": counts.late, "packets_repeated": counts.repeated,
        "packets_reordered": counts.reordered, "to_board": to_board, "from_board": from_board,
    }  # fmt: skip
    text = _text(counts.lost, counts.sent, to_board, from_board)
    if share > _MOST:
        raise StageFault(
            "loss", text, "check cable, switch and duplex, and the load of the network", figures
        )
    others = [
        f"{count} {what}"
        for count, what in (
            (counts.repeated, "repeated"), (counts.reordered, "reordered"), (counts.late, "late"),
        )
        if count
    ]  # fmt: skip
    if counts.lost or others:
        figures["note"] = "; ".join([text, ", ".join(others)] if others else [text])
    return figures


def _text(lost: int, sent: int, to_board: int, from_board: int) -> str:
    if not lost:
        return "no packet is lost"
    ways = [
        f"{-net} net {way} the board" for net, way in ((to_board, "to"), (from_board, "from"))
        if net < 0
    ]  # fmt: skip
    where = f" ({', '.join(ways)})" if ways else ""
    return f"{lost} of {sent} packets are lost, {number(100 * lost / sent, 2)} %{where}"
