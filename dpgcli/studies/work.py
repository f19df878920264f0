"""What a worker does with a chunk of designs, and what it sends back."""

from dataclasses import dataclass
from time import process_time
from typing import NamedTuple

from dpgcli.exploration.executors import Chunk
from dpgcli.files.parts import PartStore, encoded
from dpgcli.studies.evaluation import Evaluation, Numbers, Tables


class Done(NamedTuple):
    """What a worker sends back: counts, CPU seconds, and the part if it could not store it.

    Without the bytes it is shorter than what a pipe takes at once: a worker that is killed
    while it sends leaves no half of a message, for the rest of which the pool would wait.
    """

    n_states: int
    core_seconds: float
    writing_seconds: float
    content: bytes | None


@dataclass(frozen=True)
class Work:
    """What a worker does with a chunk; `store` is None where it sees no common disk."""

    evaluation: Evaluation
    store: PartStore | None

    def __call__(self, chunk: Chunk, values: dict[str, Numbers]) -> Done:
        """Evaluate a chunk's designs, with these values by key, into a part."""
        began = process_time()
        tables = self.evaluation(chunk.start, values)
        return self.stored(chunk, tables, process_time() - began)

    def stored(self, chunk: Chunk, tables: Tables, core_seconds: float) -> Done:
        """Store the part, or send it along."""
        began = process_time()
        n_states = len(tables.states["design"])
        content = encoded(
            self.evaluation.state_columns,
            tables.states,
            self.evaluation.design_columns,
            tables.designs,
        )
        if self.store is None:
            return Done(n_states, core_seconds, process_time() - began, content)
        self.store.write(chunk.start, chunk.stop, content)
        return Done(n_states, core_seconds, process_time() - began, None)
