"""Exports of testing machines as their software writes them, of a dome whose law is known."""

from collections.abc import Callable, Sequence

import numpy as np

from dpgcli.arrays import Array
from dpgcli.calibration.bistable import law
from dpgcli.calibration.choices import CurveQuantity

TRUE = np.array([12.84, 0.043, 3.5])  # N/mm, 1, mm
KEYS = ("bistable_stiffness_N_per_mm", "force_linearity", "stroke_mm")
RATE = 0.05  # mm/s


def measured(
    hysteresis: float = 0.0,
    noise: float = 0.01,
    cycles: int = 1,
    both: bool = False,
    points: int = 301,
    largest: float = 4.2,
) -> tuple[Array, Array, Array]:
    """Time (s), travel (mm) and force (N) of loadings, and of unloadings with `both`.

    Each branch is off by the share `hysteresis` of the force: above it loading, below unloading.
    """
    up = np.linspace(0.0, largest, points)
    runs = [(up, 1.0 + hysteresis), *([(up[::-1], 1.0 - hysteresis)] if both else [])] * cycles
    travel = np.concatenate([along for along, _ in runs])
    force = np.concatenate([size * law(along, TRUE, CurveQuantity.FORCE) for along, size in runs])
    time = np.concatenate(([0.0], np.cumsum(np.abs(np.diff(travel)) / RATE + 1e-3)))
    return time, travel, force + np.random.default_rng(1).normal(0.0, noise, len(force))


def _rows(columns: Sequence[Array], separator: str, decimal: str, quote: str = "") -> str:
    lines = zip(*(column.tolist() for column in columns), strict=True)
    return "".join(
        separator.join(f"{quote}{value:.5f}{quote}".replace(".", decimal) for value in line)
        + "\r\n"
        for line in lines
    )


def bluehill(time: Array, travel: Array, force: Array) -> bytes:
    """Instron Bluehill: CSV with quotes, compressions negative, kN, a blank line after the head."""
    head = (
        '"Specimen label","dome 3"\r\n"Geometry","Circular"\r\n"Rate 1","3.00000","mm/min"\r\n\r\n'
        '"Time","Extension","Load"\r\n"(s)","(mm)","(kN)"\r\n'
    )
    lines = zip(time, -travel, -force / 1e3, strict=True)
    rows = "".join(f'"{t:.4f}","{u:.5f}","{f:.8f}"\r\n' for t, u, f in lines)
    return (head + rows).encode()


def testxpert(time: Array, travel: Array, force: Array) -> bytes:
    """ZwickRoell testXpert in German: semicolons, decimal commas, Windows' own letters."""
    head = (
        '"Prüfprotokoll";\r\n"Prüfer";"Müller"\r\n"Prüfgeschwindigkeit";3,00;"mm/min"\r\n\r\n'
        '"Prüfzeit";"Standardweg";"Standardkraft";\r\n"s";"mm";"N";\r\n'
    )
    rows = _rows((time, travel, force), ";", ",").replace("\r\n", ";\r\n")
    return (head + rows).encode("cp1252")


def mts(time: Array, travel: Array, force: Array) -> bytes:
    """MTS TestSuite: tabs, a head with a date, names and units in two rows."""
    head = (
        "MTS793|MPT|ENU|1|2|.|/|:|1|0|0|A\r\n\r\nData Acquisition: Timed\t\t\tTime:\t12.5\tSec\t"
        "11/26/2026 10:11:12 AM\r\nTime\tAxial Displacement\tAxial Force\r\nSec\tmm\tN\r\n"
    )
    return (head + _rows((time, travel, force), "\t", ".")).encode()


def labview(time: Array, travel: Array, force: Array) -> bytes:
    """LabVIEW's .lvm: two heads, a column for comments that no row has."""
    head = (
        "LabVIEW Measurement\t\r\nWriter_Version\t2\r\nReader_Version\t2\r\nSeparator\tTab\r\n"
        "Decimal_Separator\t.\r\nMulti_Headings\tYes\r\nX_Columns\tOne\r\n"
        "***End_of_Header***\t\r\n\t\r\nChannels\t2\t\t\r\n"
        f"Samples\t{len(time)}\t{len(time)}\t\r\nDate\t2026/11/26\t2026/11/26\t\r\n"
        "Y_Unit_Label\tVolts\tVolts\t\r\nX_Dimension\tTime\tTime\t\r\n"
        "X0\t0.0000000000000000E+0\t0.0000000000000000E+0\t\r\nDelta_X\t0.001000\t0.001000\t\r\n"
        "***End_of_Header***\t\t\t\r\nX_Value\tPosition\tLoad cell\tComment\r\n"
    )
    return (head + _rows((time, travel, force), "\t", ".")).encode()


def german_excel(time: Array, travel: Array, force: Array) -> bytes:
    """Excel's CSV in German: semicolons, decimal commas, a mark, line breaks in titles."""
    head = 'Zeit;"Weg\n(mm)";"Kraft\n(N)"\r\n'
    return ("\ufeff" + head + _rows((time, travel, force), ";", ",")).encode()


def unicode_text(time: Array, travel: Array, force: Array) -> bytes:
    """Excel's "Unicode text": tabs, UTF-16 with its mark."""
    head = "Zeit [s]\tWeg [µm]\tKraft [N]\r\n"
    return ("\ufeff" + head + _rows((time, 1e3 * travel, force), "\t", ",")).encode("utf-16-le")


def aligned(time: Array, travel: Array, force: Array) -> bytes:
    """Columns of equal width, parted by blanks, as old programs print them."""
    lines = zip(time, travel, force, strict=True)
    rows = "".join(f"{t:12.4f}  {u:12.5f}  {f:12.5f}\n" for t, u, f in lines)
    return (f"{'Time (s)':>12}  {'Stroke (mm)':>12}  {'Force (N)':>12}\n" + rows).encode()


def bare(time: Array, travel: Array, force: Array) -> bytes:
    """Numbers and nothing else."""
    lines = zip(time, travel, force, strict=True)
    return "".join(f"{t:.4f} {u:.5f} {f:.5f}\n" for t, u, f in lines).encode()


Export = Callable[[Array, Array, Array], bytes]
EXPORTS: dict[Export, tuple[str, str]] = {  # with the titles of travel and force
    bluehill: ("-Extension", "-Load"),
    testxpert: ("Standardweg", "Standardkraft"),
    mts: ("Axial Displacement", "Axial Force"),
    labview: ("Position", "Load cell"),
    german_excel: ("Weg", "Kraft"),
    unicode_text: ("Weg", "Kraft"),
    aligned: ("Stroke", "Force"),
    bare: ("2", "3"),
}


def options(titles: tuple[str, str]) -> list[str]:
    """The options that tell which columns they are."""
    return ["--column", f"travel_mm={titles[0]}", "--column", f"force_N={titles[1]}"]
