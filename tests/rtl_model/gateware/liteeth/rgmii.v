// Ports of the core that LiteEth 2024.12 (liteeth_gen) writes for rgmii; it does nothing.
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
    input wire rgmii_clocks_rx,
    output wire rgmii_clocks_tx,
    input wire rgmii_int_n,
    output wire rgmii_mdc,
    input wire rgmii_mdio,
    output wire rgmii_rst_n,
    input wire rgmii_rx_ctl,
    input wire [3:0] rgmii_rx_data,
    output wire rgmii_tx_ctl,
    output wire [3:0] rgmii_tx_data,
    input wire sys_clock,
    input wire sys_reset
);
endmodule
