# SPDX-License-Identifier: GPL-3.0-or-later
"""Dataclasses of arrays to and from a JSON tree beside a list of arrays, and a hash of their content."""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

ARRAY_KEY = "$array"


def flatten(value: Any) -> tuple[Any, list[np.ndarray]]:
    """A JSON-able tree in which every array is replaced by its index in the returned list."""
    arrays: list[np.ndarray] = []
    return _flatten(value, arrays), arrays


def _flatten(value: Any, arrays: list[np.ndarray]) -> Any:
    if isinstance(value, np.ndarray):
        arrays.append(np.ascontiguousarray(value))
        return {ARRAY_KEY: len(arrays) - 1}
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: _flatten(getattr(value, f.name), arrays) for f in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {str(key): _flatten(item, arrays) for key, item in value.items()}
    if isinstance(value, tuple | list):
        return [_flatten(item, arrays) for item in value]
    if isinstance(value, np.generic):
        return value.item()
    return value


def unflatten(tree: Any, arrays: Sequence[np.ndarray]) -> Any:
    """The tree with arrays in place again: dicts, lists and arrays; `scene_codec` turns them into dataclasses."""
    if isinstance(tree, dict):
        if ARRAY_KEY in tree:
            return arrays[tree[ARRAY_KEY]]
        return {key: unflatten(item, arrays) for key, item in tree.items()}
    if isinstance(tree, list):
        return [unflatten(item, arrays) for item in tree]
    return tree


def content_hash(value: Any) -> str:
    """SHA-256 of a dataclass's field values and array bytes (with dtype and shape), as 64 hex digits."""
    tree, arrays = flatten(value)
    digest = hashlib.sha256(json.dumps(tree, sort_keys=True).encode())
    for array in arrays:
        digest.update(f"{array.dtype.str}{array.shape}".encode())
        digest.update(array.tobytes())
    return digest.hexdigest()
