"""The top module of a target: clock, reset at power-on, serial line and LED around viform_board."""

from __future__ import annotations

import math

from rtl_model.gateware.targets import Target
from rtl_model.geometry import Geometry

__all__ = ["PORTS", "TOP", "pins", "top_module"]

TOP = "viform_top"
"""Name of the module and, with `.v`, of its file."""

PORTS = ("clk_in", "serial_rx", "serial_tx", "led")
"""Its ports. The constraints name each of them, and no other."""

_OPEN = {  # outputs of viform_board that no pin shows, with their widths
    "sink_valid": 1, "sink_row": 16, "sink_tile": 16, "sink_bits": 0, "tile_valid": 1,
    "tile_clock": 32, "tile_frame": 32, "tile_row": 16, "tile_index": 16, "tile_bits": 0,
    "soft_reset": 1,
}  # fmt: skip  # 0: as many as lanes


def pins(target: Target) -> dict[str, str]:
    """Returns the pin of each port."""
    return dict(zip(PORTS, (target.clock, target.rx, target.tx, target.led), strict=True))


def top_module(target: Target, geometry: Geometry, build: int) -> str:
    """Returns the Verilog-2005 of `viform_top`.

    Reset is held for 255 clocks after configuration, by a counter that configuration sets to 0. The
    LED blinks once in one to two seconds, and eight times as fast while `serial_rx` is low and for
    an eighth to a quarter of a second after. build: parameter BUILD, what `ctrl_build` says.
    """
    parameters = [f".{name}({value})" for name, value in geometry.verilog.items()]
    parameters.append(f".BUILD(32'h{build:08X})")
    wires = "".join(
        f"    wire {_span(bits or geometry.lanes)}{name};\n" for name, bits in _OPEN.items()
    )
    beat = math.ceil(math.log2(geometry.clock_hz))  # bits that turn over in one to two seconds
    hold = beat - 3
    lit = f"held != {hold}'d0 ? beat[{beat - 4}] : beat[{beat - 1}]"
    return f"""\
// {target.board}, {target.part}:
// what stands around viform_board. Made by `viform board gateware {target.name}`.
module {TOP} (
    input wire clk_in,
    input wire serial_rx,
    output wire serial_tx,
    output wire led
);
{_clock(target)}
    // Configuration sets the counter to 0, so reset is held from the first clock on.
    reg [7:0] awake = 8'd0;
    wire rst = awake != 8'hFF;
    always @(posedge clk) if (rst) awake <= awake + 8'd1;

    // The LED: slow is alive, fast is a low level on serial_rx, now or a moment ago.
    reg [{beat - 1}:0] beat = {beat}'d0;
    reg [{hold - 1}:0] held = {hold}'d0;
    reg [1:0] heard = 2'b11;
    always @(posedge clk) begin
        beat <= beat + {beat}'d1;
        heard <= {{heard[0], serial_rx}};
        if (!heard[1]) held <= {{{hold}{{1'b1}}}};
        else if (held != {hold}'d0) held <= held - {hold}'d1;
    end
    wire lit = {lit};
    assign led = {"!lit" if target.led_low else "lit"};

    // The display's pins and each tile, for logic of your own; no pin of the board shows them.
{wires}    wire unused = &{{
        1'b0, {_wrapped(list(_OPEN))}
    }};

    viform_board #(
        {_wrapped(parameters)}
    ) board (
        .clk(clk), .rst(rst), .serial_rx(serial_rx), .serial_tx(serial_tx),
        {_wrapped([f".{name}({name})" for name in _OPEN])}
    );
endmodule
"""


def _clock(target: Target) -> str:
    if target.divide == 1:
        return "    wire clk = clk_in;\n"
    return (
        f"    // {target.pin_hz / 1e6:g} MHz at the pin, half of it within.\n"
        '    (* keep = "true" *)\n'
        "    reg half = 1'b0;\n"
        "    always @(posedge clk_in) half <= !half;\n"
        "    wire clk;\n"
        "    BUFG clk_buffer (.I(half), .O(clk));\n"  # 7 series: a clock tree of its own
    )


def _span(bits: int) -> str:
    return "" if bits == 1 else f"[{bits - 1}:0] "


def _wrapped(parts: list[str], width: int = 84) -> str:
    """Parts with commas between them, on lines of at most `width` behind eight blanks."""
    lines = [""]
    for part in parts:
        if lines[-1] and len(lines[-1]) + len(part) + 2 > width:
            lines.append("")
        lines[-1] += (" " if lines[-1] else "") + part + ","
    return "\n        ".join(lines).removesuffix(",")
