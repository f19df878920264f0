"""The processor cores that this process may use: those there are, affinity, a container's quota."""

import os
from collections.abc import Iterator
from contextlib import suppress
from math import ceil
from pathlib import Path

from dpgcli.records import dataclass

MOST_PROCESSES = 4096  # more than any machine has cores


@dataclass(frozen=True)
class Cores:
    """Cores of the machine, those that affinity allows, and what time a quota gives, in cores."""

    present: int
    allowed: int
    quota: float | None

    @property
    def usable(self) -> int:
        """How many processes have something to run on.

        >>> Cores(64, 8, 2.5).usable, Cores(64, 8, 0.5).usable, Cores(64, 8, None).usable
        (3, 1, 8)
        """
        return self.allowed if self.quota is None else max(1, min(self.allowed, ceil(self.quota)))


def cores(root: Path = Path("/")) -> Cores:
    """What the system says now; `root` is where its files `/proc` and `/sys` are."""
    return Cores(os.cpu_count() or 1, _allowed(), min(_quotas(root), default=None))


def _allowed() -> int:
    if hasattr(os, "process_cpu_count"):  # from Python 3.13 on
        return os.process_cpu_count() or 1
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1  # macOS and Windows before 3.13


def _quotas(root: Path) -> Iterator[float]:
    """Quotas of this process's control group and of those above it (Linux, versions 1 and 2).

    https://docs.kernel.org/admin-guide/cgroup-v2.html, `cpu.max`;
    https://docs.kernel.org/scheduler/sched-bwc.html, `cpu.cfs_quota_us`.
    """
    for group in _control_groups(root):
        with suppress(OSError, ValueError):
            quota, period = (group / "cpu.max").read_text().split()
            yield float(quota) / float(period)  # "max" is no number
        with suppress(OSError, ValueError):
            quota_us = float((group / "cpu.cfs_quota_us").read_text())
            if quota_us > 0:
                yield quota_us / float((group / "cpu.cfs_period_us").read_text())


def _control_groups(root: Path) -> Iterator[Path]:
    """Folders of control groups; in a container the group's own name may be the host's."""
    mount = root / "sys/fs/cgroup"
    lines = []
    with suppress(OSError):
        lines = (root / "proc/self/cgroup").read_text().splitlines()
    for line in lines:
        _, controllers, name = line.split(":", 2)
        if not controllers or "cpu" in controllers.split(","):
            place = mount / controllers
            own = place / name.lstrip("/")
            yield own
            yield from (above for above in own.parents if above.is_relative_to(place))
