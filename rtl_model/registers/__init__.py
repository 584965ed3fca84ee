"""The register map: one table, and the files that are generated from it."""

from rtl_model.registers.csr_csv import csr_csv
from rtl_model.registers.table import (
    MAGIC,
    MEMORIES,
    REGISTERS,
    VERSION,
    WRITE_WORDS,
    Field,
    Register,
    identifier,
    mask,
    parameters,
    quantum,
    reset_value,
)

__all__ = [
    "MAGIC",
    "MEMORIES",
    "REGISTERS",
    "VERSION",
    "WRITE_WORDS",
    "Field",
    "Register",
    "csr_csv",
    "identifier",
    "mask",
    "parameters",
    "quantum",
    "reset_value",
]
