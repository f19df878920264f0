"""What columns rest on, in the metadata of a table."""

import pyarrow as pa
import pytest

from dpgcli.design.outputs import Basis, Output, Trust
from dpgcli.files.trust import outputs_of, trust_metadata, trusts_in, warnings_in, with_bases
from dpgcli.states.columns import Column
from dpgcli.states.quantities import declared
from dpgcli.sweeps.metrics import METRICS

TRUSTS = (
    Trust(Output.GROUND, Basis.FITTED, "10 %", "hinge.yaml"),
    Trust(Output.INVERTED, Basis.PUBLISHED, "", "walls", doubt="rigid", instead="say"),
    Trust(Output.AXIAL, Basis.ASSUMED, "", "bars"),
)


def field(name: str, outputs: str | None) -> pa.Field:
    said = {"unit": "mm"} if outputs is None else {"unit": "mm", "outputs": outputs}
    return pa.field(name, pa.float64(), metadata=said)


@pytest.mark.parametrize(
    ("outputs", "basis"),
    [
        ("ground stiffness", b"fitted"),
        ("stiffness along the bars", b"assumed"),
        ("stiffness along the bars, ground stiffness, inverted stiffness", b"published"),
        ("ground stiffness, shapes", b"fitted"),
        ("shapes", None),
        ("hearsay", None),
        (None, None),
    ],
)
def test_the_basis_of_a_column_is_the_gravest(outputs: str | None, basis: bytes | None) -> None:
    """One that is doubted before all others."""
    described = with_bases(pa.schema([field("a", outputs)]), trust_metadata(TRUSTS, ()))
    said = described.field("a").metadata
    assert said.get(b"basis") == basis
    assert said[b"unit"] == b"mm"


def test_outputs_keep_their_order() -> None:
    found = outputs_of(field("a", "stiffness along the bars, hearsay, ground stiffness"))
    assert found == (Output.AXIAL, Output.GROUND)


def test_metadata_come_back() -> None:
    said = trust_metadata(TRUSTS, ["a.yaml: one", "b.yaml: two"])
    assert tuple(trusts_in(said).values()) == TRUSTS
    assert warnings_in(said) == ["a.yaml: one", "b.yaml: two"]


def test_every_number_of_the_model_shows_an_output() -> None:
    """All but counts of patterns, texts, the solver's errors and what is said of errors."""
    kinds = ("bistable", "wall", "hinge", "bar")
    columns: tuple[Column, ...] = (*declared(2, kinds, True), *METRICS)
    silent = {column.name for column in columns if not column.outputs}
    assert silent == {
        "pattern",
        "reached_pattern",
        "residual_N",
        "numerical_error_mm",
        "n_units",
        "n_states",
        "n_unknown_states",
        "n_unknown_grasps",
        "max_residual_N",
        "max_numerical_error_mm",
    }
