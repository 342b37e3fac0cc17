"""What the machine has to give."""

from __future__ import annotations

import os
from contextlib import suppress
from pathlib import Path

_CGROUPS = (  # limit and use of a container, of both versions
    ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory.current", "/sys/fs/cgroup/memory.stat"),
    (
        "/sys/fs/cgroup/memory/memory.limit_in_bytes", "/sys/fs/cgroup/memory/memory.usage_in_bytes",
        "/sys/fs/cgroup/memory/memory.stat",
    ),
)  # fmt: skip


def cores() -> int:
    """How many cores this process may use."""
    allowed = getattr(os, "sched_getaffinity", None)
    return len(allowed(0)) if allowed is not None else os.cpu_count() or 1


def free_memory() -> float:
    """Bytes that this process may still take: of the machine, of its container, and of its own limit of addresses."""
    return max(0.0, min(_of_machine(), _of_container(), _of_process()))


def _of_machine() -> float:
    with suppress(OSError, ValueError):
        for line in Path("/proc/meminfo").read_text().splitlines():
            if line.startswith("MemAvailable:"):
                return 1024.0 * int(line.split()[1])
    try:
        return float(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"))
    except (OSError, ValueError, AttributeError):
        return float("inf")


def _of_container() -> float:
    free = float("inf")
    for limit, used, kinds in _CGROUPS:
        with suppress(OSError, ValueError):
            cached = sum(  # what is kept of files is given back
                int(line.split()[1])
                for line in Path(kinds).read_text().splitlines()
                if line.startswith(("inactive_file ", "total_inactive_file "))
            )
            free = min(free, int(Path(limit).read_text()) - int(Path(used).read_text()) + float(cached))
    return free


def _of_process() -> float:
    try:
        import resource

        limit, _ = resource.getrlimit(resource.RLIMIT_AS)
        if limit == resource.RLIM_INFINITY:
            return float("inf")
        pages = int(Path("/proc/self/statm").read_text().split()[0])
        return float(limit - pages * os.sysconf("SC_PAGE_SIZE"))
    except (ImportError, OSError, ValueError):
        return float("inf")
