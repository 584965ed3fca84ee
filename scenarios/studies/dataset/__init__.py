"""Data sets: many scenes through many cameras, with their truth. Reading one loads little."""
