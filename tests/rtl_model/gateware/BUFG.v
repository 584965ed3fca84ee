// What a 7 series' global clock buffer does, for simulators, which have no library of it.
module BUFG (
    input wire I,
    output wire O
);
    assign O = I;
endmodule
