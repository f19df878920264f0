"""Units that a table says itself, for every reader: converted or refused, never passed."""

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

import dpgcli
from dpgcli.errors import SpecError
from dpgcli.files.histories import read_history
from dpgcli.files.known_states import read_states
from dpgcli.files.measured import read_curve, read_moments, read_table
from dpgcli.files.scene_file.forces import read_forces
from dpgcli.files.sweep_file import read_sweep

STATES = {"pattern": ["00", "11"], "tip_x_mm": [27.0, 22.0], "tip_y_mm": [0.1, -9.0]}


def of_states(path: Path, n_units: int = 2) -> list[Any]:
    known = read_states(path, n_units)
    return [known.tip, known.angles, known.openings, known.pushes, known.moments, known.seconds]


def of_one_unit(path: Path) -> list[Any]:
    return of_states(path, 1)


def of_shapes(path: Path) -> list[Any]:
    return [*read_states(STATES, 2, path).shapes]


def of_curve(path: Path) -> list[Any]:
    curve = read_curve(path).curve
    return [curve.travel, curve.energy, curve.force, curve.pressure, curve.volume, curve.time]


def of_hinge(path: Path) -> list[Any]:
    return [(found := read_moments(path)).moment, found.rotation]


def of_grid(path: Path) -> list[Any]:
    return [(found := read_table(path)).geometry, *found.quantities.values()]


def of_history(path: Path) -> list[Any]:
    return [*read_history(path, ["A", "B"]).values()]


def of_rows(path: Path) -> list[Any]:
    return [*read_history(path, ["A"]).values()]


def of_forces(path: Path) -> list[Any]:
    return [*read_forces(path).values()]


def of_designs(path: Path) -> list[Any]:
    base = Path(dpgcli.__file__).parent.parent / "configs" / "three_unit.yaml"
    sweep = path.with_name("sweep.yaml")
    sweep.write_text(f"base: {base}\nspace: [{{table: {path.name}}}]\n")
    (axis,) = read_sweep(sweep).space.axes
    return [*axis.values.values()]


Reader = Callable[[Path], list[Any]]
READERS: dict[str, tuple[Reader, dict[str, list[Any]]]] = {
    "states": (
        of_states,
        STATES
        | {"tip_angle_rad": [0.0, -0.5], "chamber2_angle_rad": [0.0, -0.25]}
        | {"opening1_mm": [0.0, 3.5], "push2_N": [0.0, 1.0]}
        | {"moment_N_mm": [0.0, 2.0], "seconds": [1.0, 2.0]},
    ),
    "one unit": (
        of_one_unit,
        {"unit": ["ground", "inverted"], "moment_N_mm": [1.0, 2.0]}
        | {"chamber2_angle_rad": [-0.1, -0.3], "opening_mm": [1.0, 3.5], "push_N": [0.0, 1.2]},
    ),
    "shapes": (of_shapes, {"pattern": ["00"] * 2, "x_mm": [0.0, 27.0], "y_mm": [1.0, 2.0]}),
    "curve": (
        of_curve,
        {"travel_mm": [0.0, 3.0, 14.0], "energy_mJ": [0.0, 20.0, 60.0]}
        | {"force_N": [0.0, 9.0, 4.0], "pressure_MPa": [0.0, 0.1, 0.15]}
        | {"volume_mm3": [0.0, 200.0, 900.0], "time_s": [0.0, 1.0, 2.0]},
    ),
    "hinge": (of_hinge, {"moment_N_mm": [1.0, 5.0], "rotation_rad": [0.1, 0.4]}),
    "grid": (
        of_grid,
        {"dome_height_mm": [4.5, 6.5], "elastic_modulus_MPa": [20.0, 26.0]}
        | {"hinge_stiffness_N_mm_per_rad": [24.0, 25.0], "wall_compliance_mm_per_N": [0.8, 0.9]}
        | {"bistable_stiffness_N_per_mm": [0.4, 0.5], "force_linearity": [0.04, 0.05]}
        | {"limit_pressure_MPa": [0.1, 0.15]},
    ),
    "history": (
        of_history,
        {"time_s": [0.0, 1.0], "A_MPa": [0.0, 0.15], "B_MPa": [0.0, 0.1]},
    ),
    "history by rows": (
        of_rows,
        {"time_s": [0.0, 1.0], "line": ["A", "A"], "pressure_MPa": [0.0, 0.15]},
    ),
    "forces": (
        of_forces,
        {"jaw_gap_mm": [20.0, 30.0, 40.0, 50.0], "force_N": [0.9, 0.6, 0.2, 0.1]},
    ),
    "designs": (
        of_designs,
        {"finger.geometry.dome_height_mm": [6.0, 6.5]}
        | {"finger.geometry.dome_thickness_mm": [0.7, 0.75]},
    ),
}
OTHER = {  # by how a name ends, another unit of the quantity, and how a name may have it instead
    "_N_mm_per_rad": ("N m/rad", "_N_m_per_rad"),
    "_mm_per_N": ("cm/N", "_cm_per_N"),
    "_N_per_mm": ("N/m", "_N_per_m"),
    "_N_mm": ("N cm", "_N_cm"),
    "_mm3": ("ml", "_ml"),
    "_mm": ("cm", "_cm"),
    "_rad": ("deg", "_deg"),
    "_N": ("cN", "_cN"),
    "_mJ": ("J", "_J"),
    "_MPa": ("kPa", "_kPa"),
    "_s": ("ms", "_ms"),
    "seconds": ("min", "seconds_min"),
    "force_linearity": ("%", "force_linearity_percent"),
}
COLUMNS = [
    (reader, name, next(end for end in OTHER if name.endswith(end)))
    for reader, (_, table) in READERS.items()
    for name in table
    if name not in ("pattern", "unit", "line")
]


def written(path: Path, table: dict[str, list[Any]], units: dict[str, str] | None = None) -> Path:
    rows = [list(table), *([units.get(name, "") for name in table] for _ in range(bool(units)))]
    rows += map(list, zip(*table.values(), strict=True))
    path.write_text("".join(",".join(map(str, row)) + "\n" for row in rows))
    return path


def renamed(table: dict[str, list[Any]], name: str, other: str) -> dict[str, list[Any]]:
    return {other if key == name else key: values for key, values in table.items()}


def is_refused(read: Reader, path: Path, *words: str) -> bool:
    try:
        read(path)
    except SpecError as error:
        said = str(error)
        return all(word in said for word in words)
    return False


def are_same(found: list[Any], expected: list[Any]) -> bool:
    pairs = zip(found, expected, strict=True)
    return all(a is b or np.array_equal(a, b, equal_nan=True) for a, b in pairs)


@pytest.mark.parametrize(("reader", "name", "end"), COLUMNS)
def test_another_unit_is_refused_wherever_the_file_says_it(
    tmp_path: Path, reader: str, name: str, end: str
) -> None:
    """Below the header, above it, behind the name, and in a data frame."""
    read, table = READERS[reader]
    unit, _ = OTHER[end]
    others = dict.fromkeys(table, "") | {name: f"[{unit}]"}
    path = written(tmp_path / "t.csv", table, others)
    shown = name.replace("opening_", "opening1_").replace("push_", "push1_").split(".")[-1]
    assert is_refused(read, path, shown, f"[{unit}]" if reader == "designs" else unit)
    for title in (f"{name} ({unit})", f"{name} [{unit}]"):
        assert is_refused(read, written(path, renamed(table, name, title)), shown), title
    head, units, *rows = written(path, table, others).read_text().splitlines(keepends=True)
    path.write_text("".join((units, head, *rows)))
    assert is_refused(read, path), "above the header"
    if reader != "designs":
        frame = pd.DataFrame(table).astype(object)
        top = pd.DataFrame({key: [text] for key, text in others.items()})
        assert is_refused(read, pd.concat([top, frame]), shown, unit)  # type: ignore[arg-type]


@pytest.mark.parametrize(("reader", "name", "end"), COLUMNS)
def test_a_row_of_units_counts_wherever_it_stands(
    tmp_path: Path, reader: str, name: str, end: str
) -> None:
    """With the 1 of no unit beside it, above another row, against another one, and in words."""
    read, table = READERS[reader]
    unit, _ = OTHER[end]
    if reader == "designs":  # the first row is the header, whatever it says
        return
    path = written(tmp_path / "t.csv", table)
    head, *rows = path.read_text().splitlines(keepends=True)

    def row(cell: str, other: str = "") -> str:
        return ",".join(cell if key == name else other for key in table) + "\n"

    own = end.replace("_per_", "/").replace("_", " ").strip()
    own = {"seconds": "s", "force linearity": "-"}.get(own, own)
    ones, text = row(unit, "1"), row("all of it", "text")
    for lines, said in (
        ([ones, head, *rows], unit),
        ([ones, text, head, *rows], unit),
        ([row(unit), text, "Lot,7\n", head, *rows], unit),
        ([row(own), row(unit), head, *rows], unit),
        ([row(unit), head, row(own), *rows], unit),
        ([row("Quadratzoll", "-"), head, *rows], "Quadratzoll"),
        ([row("centimeters", "newtons"), head, *rows], "centimeters"),
        ([row("KN"), head, *rows], "KN"),
    ):
        path.write_text("".join(lines))
        assert is_refused(read, path, said), lines


def test_the_1_of_no_unit_below_the_header_is_no_point_of_a_curve(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    path.write_text("moment_N_mm,x,rotation_rad\nN mm,1,rad\n1,0,0.1\n5,0,0.4\n")
    assert read_moments(path).moment.tolist() == [1.0, 5.0]
    path.write_text("side,moment_N_mm,rotation_rad\nL,1,1\nL,5,1.4\nh,6,1.5\n")
    assert read_moments(path).moment.tolist() == [1.0, 5.0, 6.0]


@pytest.mark.parametrize("text", ["Gauge length,1,mm", "Operator,Min,Max", "Load cell,5 kN,"])
def test_what_is_said_of_a_machine_is_no_row_of_units(tmp_path: Path, text: str) -> None:
    path = tmp_path / "t.csv"
    path.write_text(f"{text}\nmoment_N_mm,rotation_rad,n\n1,0.1,1\n5,0.4,2\n")
    assert read_moments(path).moment.tolist() == [1.0, 5.0]


@pytest.mark.parametrize("reader", [key for key in READERS if key != "designs"])
def test_the_own_units_above_a_header_change_nothing(tmp_path: Path, reader: str) -> None:
    read, table = READERS[reader]
    own = {
        name: {"_s": "s", "seconds": "s", "force_linearity": "1"}.get(end, end)
        for _, name, end in COLUMNS
        if name in table
    }
    units = [own.get(name, "-").replace("_per_", "/").replace("_", " ").strip() for name in table]
    path = written(tmp_path / "t.csv", table)
    expected = read(path)
    path.write_text(f"{','.join(units)}\nof a test\n{path.read_text()}")
    assert are_same(read(path), expected)


@pytest.mark.parametrize(("reader", "name", "end"), COLUMNS)
def test_the_own_unit_changes_nothing(tmp_path: Path, reader: str, name: str, end: str) -> None:
    read, table = READERS[reader]
    own = end.replace("_per_", "/").replace("_", " ").strip()
    unit = {"seconds": "s", "force linearity": "-"}.get(own, own)
    expected = read(written(tmp_path / "t.csv", table))
    if reader == "designs":  # whose columns are keys and nothing else
        return
    for title in (f"{name} ({unit})", f"{name} [{unit}]"):
        assert are_same(read(written(tmp_path / "t.csv", renamed(table, name, title))), expected)
    if unit != "-":
        assert are_same(read(written(tmp_path / "t.csv", table, {name: unit})), expected)


@pytest.mark.parametrize(
    ("reader", "name", "end"), [each for each in COLUMNS if each[2].startswith("_")]
)
def test_a_name_with_another_unit_is_no_column_that_is_left_out(
    tmp_path: Path, reader: str, name: str, end: str
) -> None:
    read, table = READERS[reader]
    if name == "limit_pressure_MPa":  # which is nothing of ours, and stays what it is
        return
    other = name.removesuffix(end) + OTHER[end][1]
    assert is_refused(
        read, written(tmp_path / "t.csv", renamed(table, name, other)), other.split(".")[-1]
    )
    if reader not in ("designs", "history"):
        for title in (f"{name}~x", name.replace(name[0], name[0].upper(), 1)):
            path = written(tmp_path / "t.csv", renamed(table, name, title))
            needs_all = reader in ("forces", "history by rows")  # then it is not there
            expected = "header: expected" if needs_all else f"expected {name}, in "
            assert is_refused(read, path, expected), title


@pytest.mark.slow
def test_every_reader_of_tables_is_here() -> None:
    """Whoever reads a sheet, or a table of designs."""
    found = {}
    for path in Path(dpgcli.__file__).parent.rglob("*.py"):
        calls = re.findall(
            r"(?<!def )\b(?:read_sheet|frame_in|read_csv)\(", path.read_text("utf-8")
        )
        found |= {path.name: len(calls)} if calls else {}
    assert found == {"known_states.py": 2, "measured.py": 3, "histories.py": 1, "forces.py": 1} | {
        "space.py": 1,  # of designs
        "tables.py": 1,
    }


def test_a_frame_in_another_unit(tmp_path: Path) -> None:
    for said in ("first_station_cm: 0.5, 0.07", "tip_offset_m: 0, 0", "tip_offset: 1, 2"):
        path = written(tmp_path / "t.csv", STATES)
        path.write_text(f"# {said}\n{path.read_text()}")
        with pytest.raises(SpecError, match="first_station_mm or tip_offset_mm, in mm"):
            read_states(path, 2)


OWN_FRAME = "# first_station_mm: 5.375, 0.75"


@pytest.mark.parametrize(
    "line",
    [
        *(
            "# first_station_mm [cm]: 0.5375, 0.075",
            "# First_station_mm: 5, 0",
            "# tip offset: 1, 2",
        ),
        *("# first_station_mm = 5, 0", "# FIRST-STATION 5 0", "first_station_mm: 5, 0"),
        *("first_station_mm;5;0", "// first_station_mm: 5, 0", '"first_station_mm","5","0"'),
        *(
            "# first_station_mm (mm): 5, 0",
            "#% first_station_mm: 5, 0",
            "# first_stations_mm: 5, 0",
        ),
    ],
)
def test_what_may_be_a_frame_is_no_remark_that_is_left_out(tmp_path: Path, line: str) -> None:
    path = written(tmp_path / "t.csv", STATES)
    path.write_text(f"{line}\n{path.read_text()}")
    with pytest.raises(SpecError, match=r"1: comment: .*first_station_mm or tip_offset_mm, in mm"):
        read_states(path, 2)


@pytest.mark.parametrize("other", ["5.375, -0.75", "0.5375, 0.075 cm", "5.375; 0.75", "5.375", ""])
def test_a_frame_is_one(tmp_path: Path, other: str) -> None:
    path = written(tmp_path / "t.csv", STATES)
    table = path.read_text()
    again = f"# first_station_mm: {other}\n"
    for text in (f"{OWN_FRAME}\n{again}{table}", f"{OWN_FRAME}\n{table}{again}"):
        path.write_text(text)
        with pytest.raises(SpecError, match=r"first_station_mm: expected (each point|two numbers)"):
            read_states(path, 2)


@pytest.mark.parametrize(
    "text",
    [
        *(f"{OWN_FRAME}\n{OWN_FRAME}\n{{}}", f"{OWN_FRAME},,\n{{}}", f'"{OWN_FRAME}",,\n{{}}'),
        *(f"{{}}{OWN_FRAME}\n", "#first_station_mm:[5.375,0.75]\n{}"),
        f"# The first station, 2: at\n# first station\n{OWN_FRAME}\n{{}}",
    ],
)
def test_a_frame_that_is_one_is_taken(tmp_path: Path, text: str) -> None:
    path = written(tmp_path / "t.csv", STATES)
    path.write_text(text.format(path.read_text()))
    assert read_states(path, 2).first_station == (5.375, 0.75)


def test_a_chosen_column_has_the_unit_that_the_file_says(tmp_path: Path) -> None:
    """Whatever stands in brackets behind another title."""
    from dpgcli.files.csv_file import Choice

    table = {"Weg (cm)": [0.0, 1.4], "force_N (raw)": [1, 1], "Load [kN]": [0.0, 0.009]}
    choice = Choice(columns={"travel_mm": "Weg", "force_N": "Load"})
    found = read_curve(written(tmp_path / "t.csv", table), choice=choice)
    assert found.curve.travel.tolist() == [0.0, 14.0]
    assert found.curve.force is not None
    assert found.curve.force.tolist() == [0.0, 9.0]
    assert found.ignored == ("force_N (raw)",)


@pytest.mark.parametrize(
    "title",
    [
        "Moment_Nm",
        "moment_N_m",
        "M Nm",
        "M, Nm",
        "M {Nm}",
        "M <Nm>",
        "M [Nm] x",
        "M\nNm",
        "M\n(Nm)",
        "M/Nm",
        "M-Nm",
        "momentNm",
        "Nm",
        "M: N m",
        "M N·m, raw",
        "M （Nm）",
        "Nm of M",
    ],
)
@pytest.mark.parametrize("is_by_place", [False, True])
def test_a_unit_anywhere_in_the_title_of_a_chosen_column_counts(
    tmp_path: Path, title: str, *, is_by_place: bool
) -> None:
    from dpgcli.files.csv_file import Choice

    path = tmp_path / "t.csv"
    path.write_text(f'"{title}",phi\n0.001,0.1\n0.004,0.4\n')
    source = "1" if is_by_place else " ".join(title.split())
    choice = Choice(columns={"moment_N_mm": source, "rotation_rad": "phi"})
    found = read_moments(path, choice=choice)
    assert found.moment.tolist() == pytest.approx([1.0, 4.0], rel=1e-15)
    assert len(found.notes) == 1
    assert found.notes[0].endswith("times 1000 is moment_N_mm")


@pytest.mark.parametrize(
    ("column", "title", "factor"),
    [
        ("travel_mm", "disp_in", 25.4),
        ("travel_mm", "travel_cm", 10.0),
        ("travel_mm", "w_mm", 1.0),
        ("force_N", "load_gf", 0.00980665),
        ("force_N", "load_lbf", 4.4482216152605),
        ("force_N", "loadkN", 1000.0),
        ("travel_mm", "Disp_in (in)", 25.4),
        ("force_N", "F_max", 1.0),
        ("travel_mm", "Weg in [mm]", 1.0),
        ("force_N", "Load min [N]", 1.0),
        ("travel_mm", "s", 1.0),
        ("force_N", "Form", 1.0),
        ("force_N", "force_N", 1.0),
        ("travel_mm", "Travel (inch)", 25.4),
    ],
)
def test_titles_with_units_and_without(
    tmp_path: Path, column: str, title: str, factor: float
) -> None:
    from dpgcli.files.csv_file import Choice

    table = {title: [0.0, 9.0 / factor], "energy_mJ": [0.0, 90.0], "time_s": [0.0, 1.0]}
    if column != "travel_mm":
        table["travel_mm"] = [0.0, 14.0]
    geometry = {"dome_height_mm": 2.5, "dome_thickness_mm": 0.5, "elastic_modulus_MPa": 1e3}
    path = written(tmp_path / "t.csv", table)
    curve = read_curve(path, geometry, Choice(columns={column: title})).curve
    found = curve.travel if column == "travel_mm" else curve.force
    assert found is not None
    assert found.tolist() == [0.0, pytest.approx(9.0)]


@pytest.mark.parametrize(
    "title",
    [
        "load_lb",
        "LOAD_KN",
        "Load newtons",
        "load_kg",
        "Load %",
        "Load V",
        "Load_kN (N)",
        "Load s",
        "Load N, kN",
        "Last Grad",
        "Load (raw)",
        "Load kilogramme-force",
    ],
)
def test_a_unit_that_is_none_of_the_quantity_is_asked_about(tmp_path: Path, title: str) -> None:
    from dpgcli.files.csv_file import Choice

    path = tmp_path / "t.csv"
    path.write_text(f'"{title}",travel_mm\n0,0\n9,14\n')
    columns = {"force_N": title}
    with pytest.raises(SpecError, match="a unit of force"):
        read_curve(path, choice=Choice(columns=columns))
    said = read_curve(path, choice=Choice(columns=columns, units={"force": "N"}))
    assert said.curve.force is not None
    assert said.curve.force.tolist() == [0.0, 9.0]


def test_two_columns_of_a_name_are_told_apart_by_what_is_behind_it(tmp_path: Path) -> None:
    path = written(tmp_path / "t.csv", {**STATES, "tip_x_mm (std)": [1.0, 2.0]})
    known = read_states(path, 2)
    assert known.tip[0].tolist() == STATES["tip_x_mm"]
    assert known.unused == ("tip_x_mm (std)",)


def test_a_header_whose_names_all_have_units_is_found_below_other_numbers(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    above = "1,2,3\n4,5,6\n7,8,9\n"
    path.write_text(f"Lot,7\n{above}travel_mm [mm],energy_mJ [mJ]\n0,0\n14,60\n")
    assert read_curve(path).curve.travel.tolist() == [0.0, 14.0]


def test_a_name_that_ends_in_a_unit_of_something_else_is_another_column(tmp_path: Path) -> None:
    table = {"travel_mm": [0.0, 14.0], "force_N": [0.0, 9.0], "energy_min": [0.0, 1.0]}
    assert read_curve(written(tmp_path / "t.csv", table)).ignored == ("energy_min",)
