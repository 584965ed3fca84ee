// Ports of the core that LiteEth 2024.12 (liteeth_gen) writes for rmii; it does nothing.
/* verilator lint_off UNDRIVEN */
/* verilator lint_off UNUSED */
module liteeth_core (
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
    input wire rmii_clocks_ref_clk,
    input wire rmii_crs_dv,
    output wire rmii_mdc,
    input wire rmii_mdio,
    output wire rmii_rst_n,
    input wire [1:0] rmii_rx_data,
    output wire [1:0] rmii_tx_data,
    output wire rmii_tx_en,
    input wire sys_clock,
    input wire sys_reset
);
endmodule
