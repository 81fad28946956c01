# SPDX-License-Identifier: GPL-3.0-or-later
"""Parts of array work side by side in threads: NumPy lets other threads run while it is in its own loops."""

from __future__ import annotations

import os
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

from .progress import Report

Part = TypeVar("Part")
Result = TypeVar("Result")

# More gain little: between NumPy's loops one thread runs at a time.
THREADS = min(os.cpu_count() or 1, 4)


def side_by_side(
    work: Callable[[Part], Result], parts: Sequence[Part], report: Report = lambda share: None
) -> Iterator[Result]:
    """`work` of each part, in their order. Raises what it raises.

    Whoever stops asking, or raises in between, waits for the few parts that are under way. report: called with the
    share of the parts that are done, may raise.
    """
    # To start threads takes longer than a small part.
    results = _in_order(work, parts) if len(parts) > 1 else map(work, parts)
    for number, result in enumerate(results):
        report((number + 1) / len(parts))
        yield result


def _in_order(work: Callable[[Part], Result], parts: Sequence[Part]) -> Iterator[Result]:
    with ThreadPoolExecutor(THREADS) as pool:
        under_way: deque[Future[Result]] = deque()
        try:
            for part in parts:
                under_way.append(pool.submit(work, part))
                if len(under_way) > THREADS:
                    yield under_way.popleft().result()
            while under_way:
                yield under_way.popleft().result()
        finally:
            for future in under_way:
                future.cancel()


def slices(count: int, size: int) -> list[slice]:
    """0 to count - 1 in slices of `size`, the last of what is left."""
    return [slice(first, min(first + size, count)) for first in range(0, count, size)]
