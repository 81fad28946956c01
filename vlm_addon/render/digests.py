# SPDX-License-Identifier: GPL-3.0-or-later
"""Hashes of what a scene holds. An array that several things of a frame depend on is read once."""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any

import numpy as np

CHUNK_BYTES = 1 << 22
"""Arrays are hashed in pieces of this size, side by side: hashlib lets other threads run meanwhile."""
LARGE_BYTES = 1 << 18
"""Of an array that is worth handing to another thread."""
MOST_THREADS = 8


class Digests:
    """SHA-256 of values and arrays: equal where all they hold is equal, dtypes and shapes too.

    They differ from array_codec.content_hash, which is stored in files and stays as it is.
    """

    def __init__(self) -> None:
        self._remembered: dict[int, tuple[np.ndarray, str]] | None = None

    @contextmanager
    def remembered(self) -> Iterator[None]:
        """While this lasts nobody writes into arrays that were hashed, so none is read twice."""
        self._remembered = {}
        try:
            yield
        finally:
            self._remembered = None

    def of(self, *values: Any) -> str:
        """64 hex digits, of dataclasses, mappings, sequences, arrays and what JSON holds."""
        self._find(values)
        return hashlib.sha256(json.dumps(self._tree(values), sort_keys=True).encode()).hexdigest()

    def _find(self, values: Any) -> None:
        """Hashes the large arrays in `values` side by side where they will be remembered."""
        if self._remembered is None:
            return
        large = {id(array): array for array in _arrays(values) if array.nbytes >= LARGE_BYTES}
        missing = {key: array for key, array in large.items() if key not in self._remembered}
        if sum(array.nbytes for array in missing.values()) < CHUNK_BYTES:
            return
        pieces = [(key, piece) for key, array in missing.items() for piece in _pieces(array)]
        with ThreadPoolExecutor(min(MOST_THREADS, os.cpu_count() or 1)) as pool:
            found = list(pool.map(lambda item: hashlib.sha256(item[1]).digest(), pieces))
        joined: dict[int, list[bytes]] = {key: [] for key in missing}
        for (key, _), digest in zip(pieces, found, strict=True):
            joined[key].append(digest)
        for key, array in missing.items():
            self._remembered[key] = array, _array_digest(array, joined[key])

    def _of_array(self, array: np.ndarray) -> str:
        if self._remembered is not None and id(array) in self._remembered:
            return self._remembered[id(array)][1]
        digest = _array_digest(array, [hashlib.sha256(piece).digest() for piece in _pieces(array)])
        if self._remembered is not None:
            self._remembered[id(array)] = array, digest
        return digest

    def _tree(self, value: Any) -> Any:
        """`value` with a hash in place of each array."""
        if isinstance(value, np.ndarray):
            return {"array": self._of_array(value)}
        if dataclasses.is_dataclass(value) and not isinstance(value, type):
            return {field.name: self._tree(getattr(value, field.name)) for field in dataclasses.fields(value)}
        if isinstance(value, Mapping):
            return {str(key): self._tree(item) for key, item in value.items()}
        if isinstance(value, tuple | list):
            return [self._tree(item) for item in value]
        return value.item() if isinstance(value, np.generic) else value


def _arrays(value: Any) -> Iterator[np.ndarray]:
    if isinstance(value, np.ndarray):
        yield value
    elif dataclasses.is_dataclass(value) and not isinstance(value, type):
        for field in dataclasses.fields(value):
            yield from _arrays(getattr(value, field.name))
    elif isinstance(value, Mapping):
        for item in value.values():
            yield from _arrays(item)
    elif isinstance(value, tuple | list):
        for item in value:
            yield from _arrays(item)


def _pieces(array: np.ndarray) -> list[memoryview]:
    flat = np.ascontiguousarray(array).reshape(-1).view(np.uint8)
    return [flat[start : start + CHUNK_BYTES].data for start in range(0, max(len(flat), 1), CHUNK_BYTES)]


def _array_digest(array: np.ndarray, pieces: Sequence[bytes]) -> str:
    return hashlib.sha256(f"{array.dtype.str}{array.shape}".encode() + b"".join(pieces)).hexdigest()
