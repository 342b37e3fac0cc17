"""Batches: the pictures of many files, times, members and cameras, by several processes, as a plan says."""

from openswim.batches.making import Report, Work, batch
from openswim.batches.plan import Plan, read_plan

__all__ = ["Plan", "Report", "Work", "batch", "read_plan"]
