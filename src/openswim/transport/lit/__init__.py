"""Solved light: immutable, without an eye."""
