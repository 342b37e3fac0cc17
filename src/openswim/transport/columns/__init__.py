"""Columns that are lit each by itself, and layers without sides."""
