"""`dpg --version`, and with `--verbose` what it found on this machine."""

import os
import platform
import re
import shutil
import sys
import tempfile
from collections import defaultdict
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path

from dpgcli import __version__
from dpgcli.cli.streams import put
from dpgcli.code import sha256_of_code
from dpgcli.cores import cores

LIBRARIES = ("numpy", "scipy", "pyarrow")
FOR_DEVELOPERS = "test"


def print_version(*, verbose: bool) -> None:
    """Versions of what decides numbers; and where they run, which decides times."""
    libraries = ", ".join(f"{name} {metadata.version(name)}" for name in LIBRARIES)
    put(f"dpg {__version__}\npackage {sha256_of_code()[:16]}, {libraries}")
    if verbose:
        put("\n".join(_surroundings()))


def _surroundings() -> Iterator[str]:
    yield f"python: {platform.python_version()} of {sys.prefix}, on {platform.platform()}"
    yield f"package: {Path(__file__).parents[1]}"
    found = cores()
    quota = "no quota" if found.quota is None else f"a quota of {found.quota:g}"
    yield (
        f"cores: {found.present} in all, {found.allowed} by affinity, {quota}: "
        f"dpg sweep starts {found.usable} worker{'s' * (found.usable != 1)}"
    )
    yield f"temporary files: {_temporary_folder()}"
    for extra, packages in _extras().items():
        versions = ", ".join(f"{name} {_version(name)}" for name in packages)
        yield f"extra {extra}: {versions}"
    yield f"ccx, for dpg fe --run: {shutil.which('ccx') or 'not found'}"


def _temporary_folder() -> str:
    try:
        return os.fspath(tempfile.gettempdir())
    except OSError as error:
        return f"none ({error.strerror or error})"


def _extras() -> dict[str, list[str]]:
    """What each extra of the installed package asks for."""
    extras: dict[str, list[str]] = defaultdict(list)
    try:
        required = metadata.requires("dpgcli") or []
    except metadata.PackageNotFoundError:  # run from its folder
        return {}
    for text in required:
        match = re.match(r"([\w.-]+).*extra == ['\"](\w+)['\"]", text)
        if match is not None and match[2] != FOR_DEVELOPERS:
            extras[match[2]].append(match[1])
    return extras


def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "not installed"
