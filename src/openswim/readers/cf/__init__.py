"""The documented scene layout (docs/scene-format.md)."""
