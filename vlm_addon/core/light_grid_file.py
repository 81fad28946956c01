# SPDX-License-Identifier: GPL-3.0-or-later
"""Light grids in files: a magic word, a version, the length and the SHA-256 of what follows, a JSON tree, the arrays.

A file is written whole or not at all and read whole or refused. VERSION rises with every change of the classes that
are written. Where baked visibility stands beside the grid, the version is WITH_VISIBILITY, so that programs that know
none of it say so.
"""

from __future__ import annotations

import hashlib
import json
import os
import struct
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, cast, get_type_hints

import numpy as np

from . import baked_visibility
from .array_codec import flatten, unflatten
from .baked_visibility import BakedVisibility
from .errors import InvalidInput
from .light_grid import RANGE, GridSettings, LightGrid, LitTree
from .light_grid_layout import require_sound
from .light_mesh import VirtualLightMesh
from .range_grid import RangeGrid
from .whole_file import atomic_output

MAGIC = b"VLMGRID\n"
VERSION = 3
WITH_VISIBILITY = 4
# Magic word, version, length of the body, SHA-256 of all these and of the body.
_HEADER = struct.Struct("<8sIQ32s")
_TREE_LENGTH = struct.Struct("<Q")
_ALIGNMENT = 8
_READ_REMEDY = "bake the grid again, or give a whole file"
# What reading a body raises that says no light grid.
_UNREADABLE = (AttributeError, KeyError, IndexError, TypeError, ValueError, OverflowError, RecursionError, struct.error)
_PLAIN = (int, float, str)


def save_light_grid(grid: LightGrid, path: Path | str, visibility: BakedVisibility | None = None) -> None:
    """Writes `grid` as `path`, which appears whole or not at all, and `visibility` of the same lights with it.

    Raises InvalidInput where nothing can be written.
    """
    version = VERSION if visibility is None else WITH_VISIBILITY
    tree, arrays = flatten(grid if visibility is None else {"light_grid": grid, "visibility": visibility})
    described = {"tree": tree, "arrays": [{"dtype": array.dtype.str, "shape": array.shape} for array in arrays]}
    text = json.dumps(described).encode()
    text += b" " * (-len(text) % _ALIGNMENT)
    body = [_TREE_LENGTH.pack(len(text)), text]
    for array in arrays:
        body += [array.tobytes(), bytes(-array.nbytes % _ALIGNMENT)]
    length = sum(len(part) for part in body)
    header = _HEADER.pack(MAGIC, version, length, _digest(version, body))
    with atomic_output(path) as temporary, open(temporary, "wb") as file:
        file.writelines([header, *body])
        file.flush()
        os.fsync(file.fileno())


def load_light_grid(path: Path | str, light_mesh: VirtualLightMesh) -> LightGrid:
    """The grid that `save_light_grid` wrote, of these very lights.

    Raises InvalidInput, one sentence, for a file that is missing, of another kind or version, cut short or damaged,
    whose content is no light grid's, or of another light mesh.
    """
    return _loaded(Path(path), light_mesh)[0]


def load_baked_visibility(path: Path | str, light_mesh: VirtualLightMesh) -> BakedVisibility | None:
    """The baked visibility that `save_light_grid` wrote beside the grid of these very lights; None if there is none.

    Whether the scene still is what it was is for BakedVisibility.require_made_of. Raises as `load_light_grid`.
    """
    return _loaded(Path(path), light_mesh)[1]


def _loaded(path: Path, light_mesh: VirtualLightMesh) -> tuple[LightGrid, BakedVisibility | None]:
    version, body = _checked_body(path)
    try:
        tree = _tree(body)
        parts = tree if version == WITH_VISIBILITY else {"light_grid": tree}
        grid, visibility = _grid(parts["light_grid"]), None
        grid.require_made_of(light_mesh)
        require_sound(grid, light_mesh)
        if version == WITH_VISIBILITY:
            visibility = visibility_from_tree(parts["visibility"])
            baked_visibility.require_sound(visibility, len(light_mesh))
    except InvalidInput as error:
        raise InvalidInput(str(path), error.problem, error.remedy) from None
    except _UNREADABLE as error:
        problem = f"its content is not that of a light grid ({type(error).__name__}: {error})"
        raise InvalidInput(str(path), problem, _READ_REMEDY) from error
    return grid, visibility


def visibility_from_tree(tree: dict[str, Any]) -> BakedVisibility:
    """The baked visibility whose `flatten` and `unflatten` gave `tree`. Raises InvalidInput where fields are others."""
    return cast(BakedVisibility, _made(BakedVisibility, tree, "visibility"))


def _checked_body(path: Path) -> tuple[int, memoryview]:
    """The version, and what follows the header, after all checks."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InvalidInput(str(path), f"it cannot be read ({error.strerror})", "give a light grid's file") from error
    if not data.startswith(MAGIC):
        raise InvalidInput(str(path), "it is not a light grid", "give a file that bake wrote")
    if len(data) < _HEADER.size:
        raise InvalidInput(str(path), "it is cut short", _READ_REMEDY)
    _, version, length, digest = _HEADER.unpack_from(data)
    body = memoryview(data)[_HEADER.size :]
    if version not in (VERSION, WITH_VISIBILITY):
        problem = f"it is a light grid of version {version}, this program reads version {VERSION} or {WITH_VISIBILITY}"
        raise InvalidInput(str(path), problem, "bake the grid again")
    if len(body) != length:
        problem = f"it holds {len(body):,} bytes of {length:,}"
        raise InvalidInput(str(path), problem, _READ_REMEDY)
    if _digest(version, [body]) != digest:
        raise InvalidInput(str(path), "it is damaged (its checksum does not match)", _READ_REMEDY)
    return version, body


def _tree(body: memoryview) -> Any:
    """What a body says, which another program may have written. Raises one of _UNREADABLE."""
    (text_length,) = _TREE_LENGTH.unpack_from(body)
    start = _TREE_LENGTH.size
    described = json.loads(bytes(body[start : start + text_length]))
    start += text_length
    arrays: list[np.ndarray] = []
    for entry in described["arrays"]:
        dtype, shape = np.dtype(entry["dtype"]), tuple(entry["shape"])
        count = int(np.prod(shape, dtype=np.int64))
        arrays.append(np.frombuffer(body, dtype, count, start).reshape(shape))
        size = count * dtype.itemsize
        start += size + -size % _ALIGNMENT
    return unflatten(described["tree"], arrays)


def _grid(values: dict[str, Any]) -> LightGrid:
    """The grid of a tree. Raises InvalidInput, or one of _UNREADABLE."""
    settings = _made(GridSettings, values["settings"], "settings")
    structure = RangeGrid if settings.mode == RANGE else LitTree
    kinds = {name: structure for name in ("static", "dynamic") if values[name] is not None}
    return cast(LightGrid, _made(LightGrid, values, "light grid", kinds))


def _made(kind: Any, tree: dict[str, Any], name: str, kinds: Mapping[str, Any] | None = None) -> Any:
    """The dataclass `kind`, and those within it, from the tree of its fields. kinds: of fields that may be several.

    Raises InvalidInput where fields are missing, too many, or of another type.
    """
    types = get_type_hints(kind) | dict(kinds or {})
    names = [field.name for field in fields(kind)]
    if set(tree) != set(names):
        problem = f"its {name} has the fields {', '.join(sorted(tree))} in place of {', '.join(sorted(names))}"
        raise InvalidInput("light grid", problem, _READ_REMEDY)
    made = {}
    for field in names:
        of_field, value = types[field], tree[field]
        made[field] = _made(of_field, value, field) if is_dataclass(of_field) else value
        if of_field in _PLAIN and not (type(value) is of_field or (of_field is float and type(value) is int)):
            problem = f"its {field} is {value!r}, which is not of type {of_field.__name__}"
            raise InvalidInput("light grid", problem, _READ_REMEDY)
    return kind(**made)


def _digest(version: int, body: list[Any]) -> bytes:
    digest = hashlib.sha256(MAGIC + struct.pack("<I", version))
    for part in body:
        digest.update(part)
    return digest.digest()
