"""`dpg fit` on exports of testing machines: the right numbers, or a question."""

import importlib.util
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dpgcli.cli.exits import ExitCode

_spec = importlib.util.spec_from_file_location("exports", Path(__file__).parents[1] / "exports.py")
assert _spec is not None
assert _spec.loader is not None
exports = importlib.util.module_from_spec(_spec)
_spec.loader.exec_module(exports)

EQUAL = ("--travel-to-opening", "equal")
CASES = [pytest.param(*case, id=case[0].__name__) for case in exports.EXPORTS.items()]
KEYS = exports.KEYS


def values(result: Any) -> dict[str, tuple[float, float]]:
    """Fitted values and their errors by key."""
    assert result.exit_code == ExitCode.DONE, result.output
    rows = json.loads(result.stdout)
    return {row["key"]: (row["value"], row["standard_error"]) for row in rows}


@pytest.fixture
def fit(call: Any, folder: Path) -> Any:
    """Fit the bistable law to a file with this content."""

    def fitted(content: bytes, *options: str) -> Any:
        (folder / "dome.csv").write_bytes(content)
        return call("fit", "bistable", "dome.csv", "--format", "json", *EQUAL, *options)

    return fitted


@pytest.mark.parametrize(("export", "titles"), CASES)
def test_an_export_gives_the_dome_back(fit: Any, export: Any, titles: tuple[str, str]) -> None:
    found = values(fit(export(*exports.measured()), *exports.options(titles)))
    for key, true in zip(KEYS, exports.TRUE, strict=True):
        assert found[key][0] == pytest.approx(true, abs=4 * found[key][1])


@pytest.mark.parametrize(("export", "titles"), CASES)
def test_both_ways_of_the_travel_are_told_apart(
    fit: Any, export: Any, titles: tuple[str, str]
) -> None:
    """Loading is 6 % above the law, unloading below it: half the difference is in the error."""
    content, options = export(*exports.measured(0.06, both=True)), exports.options(titles)
    both = fit(content, *options)
    stiffness = {"both": values(both)[KEYS[0]]}
    assert "hysteresis: loading and unloading alone give bistable_stiffness_N_per_mm" in both.stderr
    assert "--branches loading or unloading takes one of them" in both.stderr
    for branch in ("loading", "unloading"):
        result = fit(content, *options, "--branches", branch)
        stiffness[branch] = values(result)[KEYS[0]]
        assert "hysteresis" not in result.stderr
    true = float(exports.TRUE[0])
    assert stiffness["both"][0] == pytest.approx(true, rel=5e-3)
    assert stiffness["loading"][0] == pytest.approx(1.06 * true, rel=2e-3)
    assert stiffness["unloading"][0] == pytest.approx(0.94 * true, rel=2e-3)
    assert stiffness["both"][1] == pytest.approx(0.06 * true, rel=0.02)
    assert stiffness["loading"][1] < 0.01 * true


@pytest.mark.parametrize(("export", "titles"), CASES)
def test_an_export_asks_for_its_columns_and_the_rule_at_once(
    call: Any, folder: Path, export: Any, titles: tuple[str, str]
) -> None:
    (folder / "dome.csv").write_bytes(export(*exports.measured()))
    result = call("fit", "bistable", "dome.csv")
    assert result.exit_code == ExitCode.USAGE
    lines = result.stderr.splitlines()
    assert "expected a column pole_travel_mm or travel_mm, found " in lines[0]
    assert titles[0].removeprefix("-") in lines[0]
    assert lines[2] == "dpg: 2 problems"
    assert lines[3].startswith("dpg: --travel-to-opening is needed")
    assert len(lines) < 12


def test_the_unit_of_an_export_says_which_column_it_is(call: Any, folder: Path) -> None:
    (folder / "dome.csv").write_bytes(exports.testxpert(*exports.measured()))
    result = call("fit", "bistable", "dome.csv")
    assert "(--column 'travel_mm=Standardweg'?)" in result.stderr
    assert "(--column 'force_N=Standardkraft'?)" in result.stderr


def table(time: Any, travel: Any, force: Any, head: str = "Time,Extension,Load\n") -> bytes:
    rows = zip(time, travel, force, strict=True)
    return (head + "".join(f"{t:.4f},{u:.5f},{f:.9f}\n" for t, u, f in rows)).encode()


def asked(result: Any) -> str:
    """What a refusal says on standard error."""
    assert result.exit_code == ExitCode.USAGE, result.output
    assert result.stdout == ""
    said: str = result.stderr
    return said


NAMED = ("--column", "travel_mm=Extension", "--column", "force_N=Load")


def test_signs_are_asked_for(fit: Any) -> None:
    time, travel, force = exports.measured()
    said = asked(fit(table(time, -travel, -force), *NAMED))
    assert "(--column travel_mm=-Extension reverses it)" in said
    said = asked(fit(table(time, travel, -force), *NAMED))
    assert "the force is negative where the dome leaves its rest" in said
    assert "--column force_N=-TITLE reverses it" in said
    reversed_ones = ("--column", "travel_mm=-Extension", "--column", "force_N=-Load")
    found = values(fit(table(time, -travel, -force), *reversed_ones))
    assert found[KEYS[0]][0] == pytest.approx(exports.TRUE[0], rel=2e-3)


@pytest.mark.parametrize(("size", "guess"), [(1e-3, "kilonewtons?"), (1e3, "millinewtons?")])
def test_a_unit_that_nobody_said_is_asked_for(fit: Any, size: float, guess: str) -> None:
    time, travel, force = exports.measured()
    content = table(time, travel, size * force)
    assert guess in asked(fit(content, *NAMED))
    unit = "kN" if size < 1 else "mN"
    found = values(fit(content, *NAMED, "--units", f"force={unit}"))
    assert found[KEYS[0]][0] == pytest.approx(exports.TRUE[0], rel=2e-3)


def test_a_soft_dome_is_one_where_its_unit_is_said(fit: Any) -> None:
    time, travel, force = exports.measured()
    content = table(time, travel, 1e-3 * force)
    assert "if it is right, say so: --units force=N" in asked(fit(content, *NAMED))
    found = values(fit(content, *NAMED, "--units", "force=N"))
    assert found[KEYS[0]][0] == pytest.approx(1e-3 * exports.TRUE[0], rel=2e-3)
    said = table(time, travel, 1e-3 * force, "Time,Extension (mm),Load (N)\n")
    assert values(fit(said, *NAMED)) == found


def test_energies_in_joules_are_asked_for_as_well(fit: Any) -> None:
    time, travel, _ = exports.measured()
    energy = exports.law(travel, exports.TRUE, exports.CurveQuantity.ENERGY)
    columns = (*NAMED[:2], "--column", "energy_mJ=Load")
    assert "joules?" in asked(fit(table(time, travel, 1e-3 * energy), *columns))
    found = values(fit(table(time, travel, 1e-3 * energy), *columns, "--units", "energy=J"))
    assert found[KEYS[0]][0] == pytest.approx(exports.TRUE[0], rel=1e-4)


def test_of_thousands_of_mistakes_ten_are_shown(fit: Any) -> None:
    time, travel, force = exports.measured()
    content = table(time, travel, force).replace(b".", b":")
    lines = asked(fit(content, *NAMED)).splitlines()
    assert len(lines) == 13
    more = "expected a number, found something else in more than 100 places"
    assert lines[10:12] == [f"dome.csv: {key}: {more}" for key in ("travel_mm", "force_N")]
    assert lines[-1] == "dpg: 202 problems; of those in rows of data the first 10 are shown"
    assert lines[0].startswith("dome.csv:2: travel_mm: expected a number")


def test_curves_that_are_no_two_branches_of_one_are_asked_about(fit: Any) -> None:
    """A pusher that is not glued: on its way back it touches nothing."""
    time, travel, force = exports.measured(both=True)
    force[len(force) // 2 :] *= 0.0
    content = table(time, travel, force + 1e-3 * np.sin(np.arange(len(force))))
    said = asked(fit(content, *NAMED))
    assert "loading and unloading are two curves" in said
    assert "--branches loading or unloading takes one of them, both fits them as one" in said
    found = values(fit(content, *NAMED, "--branches", "loading"))
    assert found[KEYS[0]][0] == pytest.approx(exports.TRUE[0], rel=2e-3)
    assert fit(content, *NAMED, "--branches", "both").exit_code == ExitCode.DONE


def test_a_branch_that_is_not_there(fit: Any) -> None:
    content = table(*exports.measured())
    assert "--branches unloading: the travel only goes" in asked(
        fit(content, *NAMED, "--branches", "unloading")
    )


def test_repeated_loadings_that_soften_are_said(fit: Any) -> None:
    time, travel, force = exports.measured(0.02, both=True, cycles=3)
    size = np.repeat([1.1, 1.02, 1.0], len(force) // 3)
    content = table(time, travel, size * force)
    for options in ((), ("--column", "time_s=Time")):
        result = fit(content, *NAMED, *options)
        assert "3 loadings are fitted as one; the first and the last alone give" in result.stderr
        assert values(result)[KEYS[0]][1] > 0.01 * exports.TRUE[0]
    same = fit(table(*exports.measured(0.02, both=True, cycles=3)), *NAMED)
    assert "loadings are fitted" not in same.stderr


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--column", "Load"), "--column Load: expected NAME=TITLE, such as force_N=Load"),
        (("--column", "load_N=Load"), "--column load_N=Load: expected one of pole_travel_mm"),
        (("--column", "force_N=Extension"), "force_N=Extension: that is travel_mm already"),
        (("--column", "force_N=Lode"), "expected a column Lode, found Time, Extension, Load"),
        (("--column", "force_N=9"), "expected a column 9, found Time, Extension, Load"),
        (("--units", "force"), "--units force: expected QUANTITY=UNIT, such as force=kN"),
        (("--units", "force=mm"), "--units force=mm: expected a unit of force: N, kN"),
        (("--units", "load=kN"), "--units load=kN: expected one of travel, energy, force"),
        (("--skip", "400"), "file: expected a header and rows, found nothing"),
        (("--skip", "1"), "expected a column Extension, found 1, 2, 3"),
    ],
)
def test_choices_that_make_no_sense(fit: Any, options: tuple[str, ...], said: str) -> None:
    named = {"travel_mm": NAMED[:2], "force_N": NAMED[2:]}
    if options[0] == "--column":
        named.pop("force_N")
    given = [word for pair in named.values() for word in pair]
    assert said in asked(fit(table(*exports.measured()), *given, *options))


def test_a_hinge_of_an_export(call: Any, folder: Path) -> None:
    rows = "".join(f"{i};{i / 2:.1f};{0.0242 * i / 2 * 3.14159265 / 180:.9f}\n" for i in range(9))
    head = "Biegung;;\n\nNr;Winkel (°);Moment\n;;N*m\n"
    (folder / "h.csv").write_bytes((head + rows).replace(".", ",").encode("cp1252"))
    columns = ("--column", "rotation_rad=Winkel", "--column", "moment_N_mm=Moment")
    result = call("fit", "hinge", "h.csv", *columns, "--format", "json")
    assert values(result)["hinge_stiffness_N_mm_per_rad"][0] == pytest.approx(24.2, rel=1e-4)
    assert "Moment times 1000 is moment_N_mm" in result.stderr
