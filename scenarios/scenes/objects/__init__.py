"""Textured plates that move, turn and come closer at several depths, with their dense truth."""
