"""Who makes the numbers of a sweep or a search, by versions and code: nobody else's are taken."""

import os
import pkgutil
import platform
import sys
from functools import partial
from pathlib import Path
from typing import NamedTuple

import dpgcli
from dpgcli.code import PACKAGE, sha256_of_code, versions_of_libraries
from dpgcli.errors import WorkplaceError
from dpgcli.sweeps.executors import Backend

NO_NUMBERS = (
    "api",
    "benchmark",
    "cli",
    "finite_elements",
    "hard_cases",
    "reference",
    "reports",
)  # parts of the package that no number passes through; sweeps know calibrations by content


class Maker(NamedTuple):
    """Versions of the package and of its libraries, and the SHA-256 of the package's code."""

    dpg: str
    numpy: str
    scipy: str
    shapely: str
    code: str

    def __str__(self) -> str:
        libraries = f"NumPy {self.numpy}, SciPy {self.scipy}, Shapely {self.shapely}"
        return f"dpg {self.dpg}, {libraries}, code {self.code[:8]}"


def code_of(package: Path) -> str:
    """SHA-256 of all modules of a package that its numbers come from.

    Not `NO_NUMBERS`, so that work on what is printed leaves finished parts as they are.
    """
    return sha256_of_code(package, NO_NUMBERS)


# who works in this process, found when it began to: its files may have changed since
HERE = Maker(dpgcli.__version__, **versions_of_libraries(), code=code_of(PACKAGE))
# asked with a function that every Python has: one of this package would end a worker without it
WHO = partial(pkgutil.resolve_name, f"{__name__}:HERE")


def check_maker(maker: Maker, work: str = "sweep") -> None:
    """Raise WorkplaceError in a worker that is not the one who is to make the numbers of a work."""
    if maker != HERE:
        where = f"{platform.node()}, process {os.getpid()}, Python in {sys.prefix}"
        raise WorkplaceError(_mixed(f"a worker ({where})", str(HERE), maker, work))


def check_workers(workplace: Backend, work: str = "sweep") -> None:
    """Ask all workers that are there; raises WorkplaceError for the first that is another.

    One that goes meanwhile is none: who comes in its place is asked again at its work.
    """
    with workplace.reached():
        answers = workplace.ask(WHO)
    for worker, maker in answers.items():
        if maker != HERE and not isinstance(maker, workplace.lost):
            says = str(maker) if isinstance(maker, Maker) else f"another dpg, or none ({maker!r})"
            raise WorkplaceError(_mixed(f"worker {worker} of {workplace.name}", says, HERE, work))


def _mixed(who: str, has: str, maker: Maker, work: str) -> str:
    return (
        f"{who} has {has}, but this {work} is of {maker}: their numbers may differ; "
        "install one package everywhere and restart its workers"
    )
