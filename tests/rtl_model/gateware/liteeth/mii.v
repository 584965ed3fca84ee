// Ports of the core that LiteEth 2024.12 (liteeth_gen) writes for mii; it does nothing.
/* verilator lint_off UNDRIVEN */
/* verilator lint_off UNUSED */
module liteeth_core (
    input wire mii_clocks_rx,
    input wire mii_clocks_tx,
    input wire mii_col,
    input wire mii_crs,
    output wire mii_mdc,
    inout wire mii_mdio,
    output wire mii_rst_n,
    input wire [3:0] mii_rx_data,
    input wire mii_rx_dv,
    input wire mii_rx_er,
    output wire [3:0] mii_tx_data,
    output wire mii_tx_en,
    output wire [31:0] mmap_araddr,
    output wire [2:0] mmap_arprot,
    input wire mmap_arready,
    output wire mmap_arvalid,
    output wire [31:0] mmap_awaddr,
    output wire [2:0] mmap_awprot,
    input wire mmap_awready,
    output wire mmap_awvalid,
    output wire mmap_bready,
    input wire [1:0] mmap_bresp,
    input wire mmap_bvalid,
    input wire [31:0] mmap_rdata,
    output wire mmap_rready,
    input wire [1:0] mmap_rresp,
    input wire mmap_rvalid,
    output wire [31:0] mmap_wdata,
    input wire mmap_wready,
    output wire [3:0] mmap_wstrb,
    output wire mmap_wvalid,
    input wire sys_clock,
    input wire sys_reset
);
endmodule
