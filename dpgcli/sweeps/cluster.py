"""The workers of a Dask cluster, and what to do while none of them answers."""

import logging
import re
from collections.abc import Callable
from concurrent.futures import BrokenExecutor, CancelledError, Executor, Future
from contextlib import ExitStack
from dataclasses import field
from socket import getaddrinfo
from threading import Thread
from time import monotonic, sleep
from traceback import format_exc
from typing import Any, ParamSpec, TypeVar

from dpgcli.errors import Field, Message, NoWorkerError, UsageError
from dpgcli.records import dataclass
from dpgcli.sweeps.executors import GO_ON, PERIOD, TRIALS, Backend

P = ParamSpec("P")
R = TypeVar("R")

PATIENCE = 10  # s, for an answer of the scheduler
SILENCE = 10  # s after which a word is said
SCHEMES = ("tcp", "tls", "ws", "wss")  # of Dask's schedulers
SECRET = ("tls", "wss")
USUAL_PORT, LARGEST_PORT = 8786, 65535
ADDRESS = re.compile(
    r"(?:(?P<scheme>\w+)://)?(?P<host>\[[0-9a-fA-F:.]+\]|[^\s/:\[\]]+)(?::(?P<port>[0-9]{1,5}))?/?"
)
KEYS = "DASK_DISTRIBUTED__COMM__TLS__"  # of the environment; files in ~/.config/dask do, too


@dataclass
class WorkerWatch:
    """Reports missing or silent workers, and gives up after `limit` seconds without any."""

    name: str
    n_workers: Callable[[], int]
    limit: float
    say: Callable[[str], None]
    last_seen: float = field(default_factory=monotonic)
    is_said: bool = False

    def __call__(self, silence: float) -> None:
        """Look for workers after so many seconds without a result; may raise NoWorkerError."""
        n_workers = self.n_workers()
        now = monotonic()
        if n_workers:
            self.last_seen = now
        lonely = now - self.last_seen
        if lonely > self.limit:
            since = f"{self.name}: no worker for {lonely:.0f} s ("
            raise NoWorkerError(since, Field("wait"), f"). {GO_ON}")
        if (silence if n_workers else lonely) < SILENCE:
            self.is_said = False
        elif not self.is_said:
            self.is_said = True
            self.say(self._word(n_workers, silence))

    def _word(self, n_workers: int, silence: float) -> str:
        if not n_workers:
            waiting = f"{self.name}: no worker answers; waiting {self.limit:g} s for one ("
            return Message(waiting, Field("wait"), ")")
        who = "its worker" if n_workers == 1 else f"any of its {n_workers} workers"
        return f"{self.name}: nothing from {who} for {silence:.0f} s; waiting"


def check_address(address: str) -> None:
    """Raise UsageError for what is no address of a scheduler, with the form that works.

    >>> check_address("tcp://[::1]:8786")
    >>> check_address("localhost")
    Traceback (most recent call last):
        ...
    dpgcli.errors.UsageError: scheduler localhost: expected tcp://host:port, such as tcp://localhost:8786
    """
    found = ADDRESS.fullmatch(address)
    scheme = (found and found["scheme"]) or SCHEMES[0]
    if found and found["port"] and scheme in SCHEMES and 0 < int(found["port"]) <= LARGEST_PORT:
        return
    known = scheme if scheme in SCHEMES else SCHEMES[0]
    example = f", such as {known}://{found['host']}:{USUAL_PORT}" if found else ""
    raise UsageError(Field("scheduler"), f" {address}: expected {known}://host:port{example}")


def dask_cluster(scheduler: str, limit: float, say: Callable[[str], None]) -> Backend:
    """The workers of a Dask cluster.

    Raises UsageError for keys that are missing, OSError where no scheduler answers, NoWorkerError
    where no worker comes within `limit` seconds.
    """
    check_address(scheduler)
    from distributed import KilledWorker
    from distributed.comm.core import CommClosedError

    for name in ("distributed", "distributed.client", "tornado.application"):
        logging.getLogger(name).setLevel(logging.CRITICAL)  # what matters is raised
    name = f"the Dask cluster at {scheduler}"
    _check_reachable(scheduler)
    client = _client(scheduler)
    watch = WorkerWatch(name, lambda: len(_threads(client)), limit, say)
    with ExitStack() as opened:
        opened.callback(client.close)
        while not _threads(client):
            watch(0.0)
            sleep(PERIOD)
        n_workers = sum(_threads(client).values())
        opened.pop_all()  # whoever has the workers closes it
    return Backend(
        name,
        lambda _: ClusterExecutor(client),
        n_workers,
        is_local=False,
        broken=(BrokenExecutor, KilledWorker),
        lost=(CancelledError, CommClosedError),
        ask=lambda question: _answers(client, question),
        watch=watch,
        close=client.close,
    )


class ClusterExecutor(Executor):
    """The workers of a client of Dask; what is wrong with them is told from errors of the work.

    Work is done or raises, and both come back as results: whatever Dask itself raises is of its
    workers. One that closes, as batch systems have it, may still be sent a task, and says
    RuntimeError; Dask tries another, and if none takes it, workers are broken. (Dask's own
    executor hands this out as if it came from the work, and what is lost as worse.)
    """

    def __init__(self, client: Any) -> None:
        self.client = client

    def submit(self, fn: Callable[P, R], /, *args: P.args, **kwargs: P.kwargs) -> Future[R]:
        """Send work to some worker."""
        try:
            asked = self.client.submit(_done, fn, args, kwargs, pure=False, retries=TRIALS)
        except Exception as error:
            if self.client.status in ("closing", "closed"):  # it had lost its scheduler
                raise CancelledError(str(error)) from error
            raise
        future: Future[R] = Future()
        future.add_done_callback(lambda _: asked.release())
        self.client.loop.add_callback(_pass_on, asked, future)
        return future


def _done(
    work: Callable[..., R], args: tuple[Any, ...], kwargs: dict[str, Any]
) -> tuple[R | None, Exception | None]:
    """In a worker: what work returns, or raises."""
    try:
        return work(*args, **kwargs), None
    except Exception as error:
        error.add_note(f"in a worker:\n{format_exc()}")  # which is all that is left of it here
        return None, error


async def _pass_on(asked: Any, future: Future[Any]) -> None:
    """Wait for Dask's future, and let another have what comes of it."""
    value, error = None, None
    try:
        value, error = await asked
    except CancelledError:
        future.cancel()
    except RuntimeError as closing:
        error = BrokenExecutor(str(closing))
    except Exception as other:
        error = other
    if not future.set_running_or_notify_cancel():
        return
    if error is None:
        future.set_result(value)
    else:
        future.set_exception(error)


def _check_reachable(scheduler: str) -> None:
    """What can be known without waiting: that the host has an address, and keys are there."""
    from distributed.security import Security

    found = ADDRESS.fullmatch(scheduler)
    assert found is not None, "checked before"
    getaddrinfo(found["host"].strip("[]"), int(found["port"]))
    try:
        keys = Security().get_connection_args("client").get("ssl_context")
    except OSError as error:
        raise UsageError(Field("scheduler"), f" {scheduler}: Dask's keys: {error}") from error
    if found["scheme"] in SECRET and keys is None:
        names = ", ".join(KEYS + name for name in ("CA_FILE", "CLIENT__CERT", "CLIENT__KEY"))
        raise UsageError(Field("scheduler"), f" {scheduler}: expected keys of Dask in {names}")


def _client(scheduler: str) -> Any:
    """A client, made aside: a scheduler that takes the call and says nothing would hold it."""
    from distributed import Client

    coming: Future[Any] = Future()

    def connect() -> None:
        try:
            coming.set_result(Client(scheduler, timeout=PATIENCE, set_as_default=False))
        except Exception as error:
            coming.set_exception(error)

    Thread(target=connect, daemon=True).start()
    return coming.result(2 * PATIENCE)


def _threads(client: Any) -> dict[str, int]:
    """Threads of each worker; empty if the scheduler does not answer."""
    try:
        found: dict[str, int] = client.nthreads(callback_timeout=PATIENCE)
    except OSError:
        return {}
    return found


def _answers(client: Any, question: Callable[[], Any]) -> dict[str, Any]:
    """The answer of each worker; no answers while one is stopped."""
    try:
        found: dict[str, Any] = client.run(question, on_error="return", callback_timeout=PATIENCE)
    except TimeoutError:
        return {}
    return found
