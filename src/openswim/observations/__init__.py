"""What real cameras saw: frames and when they were taken, and the cameras that took them."""

from openswim.observations.frames import SkyFrame, read_frame

__all__ = ["SkyFrame", "read_frame"]
