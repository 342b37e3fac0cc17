"""Invented scenes: fields made from nothing but numbers."""

from openswim.scene.procedural.demo import demo_levels, demo_scene, summer_sounding

__all__ = ["demo_levels", "demo_scene", "summer_sounding"]
