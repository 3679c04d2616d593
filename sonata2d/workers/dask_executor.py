"""Dask as an executor: on a cluster, or with processes of this machine."""

from __future__ import annotations

import logging
import socket
import time
from concurrent.futures import CancelledError, Executor, Future, InvalidStateError
from contextlib import suppress
from functools import partial
from typing import TYPE_CHECKING, Any
from weakref import WeakKeyDictionary

from ..core.arguments import whole_number
from ..core.files import interruption
from ..core.files.optional import optional
from ..core.wording import described, shown
from ..errors import WorkerError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

logger = logging.getLogger(__name__)

_CONNECT_TIMEOUT = 10.0  # s, for one attempt to connect to a scheduler
_COUNT_INTERVAL = 2.0  # s, between two counts of the workers, which may come and go
_WAITING_INTERVAL = 60.0  # s, between two messages that no worker is connected
# s, to wait for a finished result; then for the task to finish again, as its worker may have ended
_FETCH_TIMEOUT = 5.0
_SHARED_FROM = 50_000  # bytes of an argument that is sent to the workers once, and not with each task


class DaskExecutor(Executor):
    """Runs tasks on a Dask cluster, through the interface of `concurrent.futures`.

    Workers may join and leave at any time: what a worker has not finished is done by another one. If the scheduler
    ends, the executor waits for it to start again at the same address, and submits again what was not finished.

    Args:
        address: of the scheduler, such as `tcp://10.0.0.5:8786`; or a `dask.distributed.Client`, as for a cluster of
            dask-jobqueue; None: starts a cluster of processes on this machine, which ends with the executor.
        workers: number of processes of that cluster; None: the number of processors.
        patience: seconds to wait for the scheduler, at the start and after its end.

    Raises:
        WorkerError: Dask is not installed, or the scheduler does not answer.
        TypeError, ValueError: an argument is something else.

    Example:
        >>> import sonata2d as s2
        >>> from sonata2d.workers import DaskExecutor
        >>> def main():
        ...     with DaskExecutor("tcp://10.0.0.5:8786") as executor:
        ...         s2.generate_dataset("/shared/demo", episodes=1_000_000, shard_size=1000, workers=executor)
    """

    def __init__(self, address: Any = None, *, workers: int | None = None, patience: float = 600.0) -> None:
        if workers is not None and address is not None:
            raise ValueError("workers is the number of processes of a cluster on this machine; leave it out")
        self._distributed = optional("distributed", WorkerError)
        self.patience = patience
        self._cluster: Any = None
        self._closes_client = not isinstance(address, self._distributed.Client)
        self._generation = 0  # number of times that the scheduler was lost
        self._generations: WeakKeyDictionary[Future[Any], int] = WeakKeyDictionary()
        self._pending: dict[Future[Any], Any] = {}  # Dask's tasks by future
        self._shared: dict[bytes, Any] = {}  # arguments that the workers have, by content
        self._counted, self._count = float("-inf"), 0
        self._warned = time.monotonic()
        if self._closes_client and not isinstance(address, str | None):
            raise TypeError(f"the address of a scheduler is a text such as tcp://10.0.0.5:8786, got {shown(address)}")
        if address is None:
            number = None if workers is None else whole_number("workers", workers, 1)
            self._cluster = self._distributed.LocalCluster(
                n_workers=number,
                threads_per_worker=1,
                dashboard_address="127.0.0.1:0",
                silence_logs=logging.CRITICAL,  # its processes also get Ctrl-C, and say so at length
            )
            address = self._cluster
        if self._closes_client:
            self._security = None
            self._connect(address)
        else:
            self._client, self._security = address, address.security
        self.address = self._client.scheduler.address

    @property
    def count(self) -> int:
        """Number of tasks that the workers run at a time: their threads."""
        for future, task in list(self._pending.items()):
            if self._is_closed or task.status == "cancelled":  # Dask omits callbacks of a closed client
                _lose(future)
        now = time.monotonic()
        if now - self._counted > _COUNT_INTERVAL:
            try:
                self._count = sum(self._client.nthreads().values())
            except Exception:  # the connection is lost, which futures will say
                return self._count
            self._counted = now
            if self._count:
                self._warned = now
            elif now - self._warned > _WAITING_INTERVAL:
                self._warned = now
                logger.warning("no Dask worker is connected to %s; waiting for one", self.address)
        return self._count

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        """Run a function on a worker; see `concurrent.futures.Executor.submit`.

        Raises:
            WorkerError: the scheduler has ended, and does not start again in time.
        """
        if self._is_closed:
            self._reconnect()
        arguments = [self._sent_once(value) if isinstance(value, bytes) else value for value in args]
        task = self._client.submit(fn, *arguments, pure=False, **kwargs)
        future: Future[Any] = Future()
        self._generations[future] = self._generation
        self._pending[future] = task
        task.add_done_callback(partial(_pass_on, future))

        def forget(future: Future[Any]) -> None:
            self._pending.pop(future, None)
            if future.cancelled() and task.status == "pending":
                task.cancel()

        future.add_done_callback(forget)
        return future

    def map(self, fn: Callable[..., Any], *iterables: Any, **settings: Any) -> Iterator[Any]:
        """Results of a function in the order of its arguments; see `concurrent.futures.Executor.map`."""
        return super().map(fn, *iterables, **settings)  # here for its docstring, which Sphinx can read

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """Disconnect, and end the cluster if it is the executor's own."""
        self._shared.clear()
        if self._closes_client:
            self._client.close(timeout=_CONNECT_TIMEOUT)
        if self._cluster is not None:
            self._cluster.close(timeout=_CONNECT_TIMEOUT)

    def recover(self, future: Future[Any], error: BaseException) -> bool:
        """Connect again after the scheduler has ended, so that a lost task can be submitted again.

        Args:
            future: of the task.
            error: what it raised.

        Returns:
            Whether the task was lost with the scheduler; False: it failed for another reason.

        Raises:
            WorkerError: the scheduler does not start again in time.
        """
        if not isinstance(error, CancelledError):
            return False
        if self._generations.get(future, self._generation) == self._generation:
            self._reconnect()
        return True

    @property
    def _is_closed(self) -> bool:
        """Whether the client has given up waiting for its scheduler."""
        return self._client.status in ("closing", "closed")

    def _reconnect(self) -> None:
        """Connect to the scheduler again; tasks of before are lost.

        Raises:
            WorkerError: it does not start again in time.
        """
        self._generation += 1
        self._shared.clear()
        logger.warning(
            "the connection to the Dask scheduler %s is lost; waiting up to %.0f s for it to start again",
            self.address,
            self.patience,
        )
        if self._closes_client:
            self._client.close(timeout=_CONNECT_TIMEOUT)
        self._closes_client = True
        self._connect(self.address)
        logger.warning("connected to the Dask scheduler %s again", self.address)

    def _connect(self, address: Any) -> None:
        """Connect to a scheduler, which may have to be waited for.

        Raises:
            WorkerError: it does not answer in time.
        """
        deadline, is_announced = time.monotonic() + self.patience, False
        while True:
            try:
                self._probe(address)
                limit = max(1.0, min(_CONNECT_TIMEOUT, deadline - time.monotonic()))
                self._client = self._distributed.Client(
                    address, timeout=limit, security=self._security, set_as_default=False
                )
                break
            except ValueError as error:
                raise WorkerError(
                    f"{address} is no address of a Dask scheduler, such as tcp://10.0.0.5:8786: {described(error)}"
                ) from error
            except (OSError, TimeoutError) as error:
                interruption.check()
                if time.monotonic() > deadline:
                    raise WorkerError(f"the Dask scheduler {address} does not answer: {described(error)}") from error
            if not is_announced:
                logger.warning("the Dask scheduler %s does not answer; waiting up to %.0f s", address, self.patience)
            is_announced = True
            time.sleep(0.5)
        self._counted = float("-inf")

    def _probe(self, address: Any) -> None:
        """Connect to an address and disconnect: a Dask client that does not reach its scheduler takes 20 s to end.

        Raises:
            OSError: nothing listens there.
            ValueError: it is no address.
        """
        if not isinstance(address, str):
            return  # a cluster on this machine
        try:
            place = self._distributed.comm.get_address_host_port(address)
        except NotImplementedError as error:  # such as inproc://
            raise ValueError("it has no host and port") from error
        socket.create_connection(place, 2.0).close()

    def _sent_once(self, content: bytes) -> Any:
        """A reference to a large argument, which all workers get once."""
        if len(content) < _SHARED_FROM or not self.count:  # without a worker, nobody could hold it
            return content
        if content not in self._shared:
            try:
                self._shared[content] = self._client.scatter(content, broadcast=True, hash=True)
            except Exception as error:  # all workers have left meanwhile, or the scheduler has ended
                logger.info("nothing can be sent to all Dask workers: %s", described(error))
                return content
        return self._shared[content]


def _pass_on(future: Future[Any], task: Any) -> None:
    """Pass the outcome of a Dask task on; called in a thread of the client.

    `Client.get_executor` is not used: its futures are never done if the scheduler ends while a result is fetched.
    """
    try:
        result = task.result(timeout=_FETCH_TIMEOUT)
    except BaseException as error:
        if task.status == "error":  # the function raised it
            with suppress(InvalidStateError):
                future.set_exception(error)
        elif isinstance(error, TimeoutError):  # the worker that holds the result does not send it
            task.add_done_callback(partial(_pass_on, future))
        else:  # lost with the scheduler
            _lose(future)
    else:
        with suppress(InvalidStateError):
            future.set_result(result)


def _lose(future: Future[Any]) -> None:
    """Cancel a future, which ends the waiting for it."""
    with suppress(RuntimeError, InvalidStateError):  # another thread has done it
        future.cancel()
        future.set_running_or_notify_cancel()
