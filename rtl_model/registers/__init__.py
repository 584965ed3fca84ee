"""The register map: one table, and what is made from it."""

from rtl_model.registers.table import MAGIC, MEMORIES, REGISTERS, VERSION, Field, Memory, Register

__all__ = ["MAGIC", "MEMORIES", "REGISTERS", "VERSION", "Field", "Memory", "Register"]
