"""A worker's task: evaluate a chunk of designs, store its part, send back counts."""

from collections.abc import Iterable, Iterator, Mapping
from io import BytesIO
from time import process_time
from typing import IO, Any, NamedTuple

from dpgcli.files.parts import PartStore, write_part
from dpgcli.records import dataclass
from dpgcli.sweeps.evaluation import DesignEvaluation, Tables
from dpgcli.sweeps.executors import Chunk
from dpgcli.sweeps.maker import Maker, check_maker
from dpgcli.sweeps.space import DesignValues


class ChunkResult(NamedTuple):
    """A worker's result: counts, CPU seconds, and the part if it could not store it.

    Without the bytes it is shorter than what a pipe takes at once: a worker that is killed
    while it sends leaves no half of a message, for the rest of which the pool would wait.
    """

    n_states: int
    core_seconds: float
    writing_seconds: float
    content: bytes | None


@dataclass(frozen=True)
class ChunkTask:
    """The task of a chunk; `store` is None where the worker sees no common disk."""

    evaluation: DesignEvaluation
    store: PartStore | None

    def __call__(self, chunk: Chunk, values: DesignValues, maker: Maker) -> ChunkResult:
        """Evaluate a chunk's designs, with these values by key, into a part by this maker."""
        check_maker(maker)
        return self.stored(chunk, self.evaluation(chunk.start, values))

    def stored(self, chunk: Chunk, blocks: Iterable[Tables]) -> ChunkResult:
        """Store the part as its blocks come, or send it along."""
        began = process_time()
        clock = _Clock()
        if self.store is None:
            sink = BytesIO()
            n_states = self._write(sink, clock.timed(blocks))
            content: bytes | None = sink.getvalue()
        else:
            content = None
            with self.store.part(chunk.start, chunk.stop) as file:
                n_states = self._write(file, clock.timed(blocks))
        return ChunkResult(n_states, clock.seconds, process_time() - began - clock.seconds, content)

    def _write(self, sink: IO[bytes], blocks: Iterable[Tables]) -> int:
        evaluation = self.evaluation
        return write_part(sink, evaluation.state_columns, evaluation.design_columns, blocks)


def reason_against(data: Mapping[str, Any], changes: Mapping[str, float]) -> str:
    """What is wrong with a design; the reader of specs is loaded by workers that meet one."""
    from dpgcli.files import scene_file

    return scene_file.reason_against(data, changes)


@dataclass
class _Clock:
    """CPU seconds that making things took, apart from what was done with them."""

    seconds: float = 0.0

    def timed(self, blocks: Iterable[Tables]) -> Iterator[Tables]:
        """The blocks, as they are."""
        blocks = iter(blocks)
        while True:
            began = process_time()
            block = next(blocks, None)
            self.seconds += process_time() - began
            if block is None:
                return
            yield block
