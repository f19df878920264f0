"""Transitions in files: a Parquet table, and a graph for Gephi, yEd and NetworkX."""

from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from dpgcli.arrays import Columns
from dpgcli.design.scene import Scene
from dpgcli.files.actuation import ColumnsAndRows
from dpgcli.files.output import Mark, whole_file
from dpgcli.files.record_batches import record_batch, schema
from dpgcli.files.scene_metadata import scene_metadata
from dpgcli.files.table_writer import SCHEMA_VERSION, versions, write_table
from dpgcli.files.trust import trust_metadata, with_bases
from dpgcli.states.columns import Column
from dpgcli.states.rows import as_text

if TYPE_CHECKING:
    import networkx as nx

Kinds: TypeAlias = tuple[Column, ...]
HEAD = "<?xml version='1.0' encoding='utf-8'?>\n<!-- written by dpg -->\n"
EDGE = ("line", "direction", "pressure_MPa", "unit", "reached_at_pressure", "tie")


def write_transitions(
    path: Path, scene: Scene, spec_json: str, reach: float, columns: Kinds, rows: Columns
) -> None:
    """Write a row for each state and direction to a Parquet file.

    How far pressures went, `reach` (MPa), is in its metadata.
    """
    metadata = {
        "dpg.schema_version": str(SCHEMA_VERSION),
        **scene_metadata(scene, spec_json),
        **trust_metadata(scene.trusts, scene.warnings),
        "dpg.largest_pressure_MPa": repr(reach),
        "dpg.versions": versions(),
    }
    described = with_bases(schema(columns), metadata)
    write_table(path, described, [record_batch(columns, rows)], metadata)


def graph_of(states: ColumnsAndRows, transitions: ColumnsAndRows) -> "nx.MultiDiGraph[str]":
    """The graph of states, a node each, and of transitions, an edge for each that ends in a state.

    Both are columns and rows; `pattern` names the nodes, and what else they have are attributes.
    Keys of edges count on through the graph: GraphML writes them as ids, of which readers may take
    no more than one edge each.
    """
    import networkx as nx

    graph: nx.MultiDiGraph[str] = nx.MultiDiGraph()
    graph.add_nodes_from((node["pattern"], node) for node in _records(*states))
    leading = (edge for edge in _records(*transitions) if edge["pattern_after"])
    for number, edge in enumerate(leading):
        attributes = {name: edge[name] for name in EDGE}
        graph.add_edge(edge["pattern"], edge["pattern_after"], key=number, **attributes)
    return graph


def write_graph(path: Path, graph: "nx.MultiDiGraph[str]") -> None:
    """Write a graph as GraphML, the same bytes for the same graph."""
    import networkx as nx

    text = "\n".join(nx.generate_graphml(graph))
    with whole_file(path, Mark.GRAPH) as temporary:
        temporary.write_text(f"{HEAD}{text}\n", encoding="utf-8", newline="\n")


def _records(columns: Kinds, rows: Columns) -> list[dict[str, Any]]:
    """Rows as objects by name."""
    values = [as_text(column, rows[column.name]).tolist() for column in columns]
    names = [column.name for column in columns]
    return [dict(zip(names, row, strict=True)) for row in zip(*values, strict=True)]
