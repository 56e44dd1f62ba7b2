"""Two things at a time, in threads, that stop when one fails or someone wants to stop."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor, as_completed
from typing import TypeVar

Item = TypeVar("Item")
Result = TypeVar("Result")


def map_in_pairs(
    one: Callable[[Item], Result],
    items: Iterable[Item],
    stop: Callable[[], object] = lambda: None,
) -> list[Result]:
    """Return the results of all items in their order, two computed at a time.

    As soon as one fails, or an interrupt comes, what has not begun is not begun, `stop` is called
    to end what has, and the failure is raised.
    """
    with ThreadPoolExecutor(2) as pool:
        try:
            futures = [pool.submit(one, item) for item in items]
            for future in as_completed(futures):
                future.result()
            return [future.result() for future in futures]
        except BaseException:
            stop()
            pool.shutdown(wait=False, cancel_futures=True)
            raise
