"""The way out of the pixel array: tiles as an AXI4-Stream.

The tiles come from emulated pixels in the FPGA or in an external memory, or from a sensor's data
lanes. Cycle models, exact in every bit and clock, stand beside the Verilog.
"""
