# SPDX-License-Identifier: GPL-3.0-or-later
"""How far the vertices of a scene's meshes have moved from one picture to the next."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..core.scene import Float64, Int32, Mesh, SceneSnapshot

MeshKey = tuple[str, int]
"""Name of a mesh and how many of the same name come before it: instances share their object's name."""


@dataclass(frozen=True)
class MeshMove:
    """A mesh that is not where it was. first_face: the number of its first triangle in the scene.

    before: (v, 3) float64, where its vertices were, m in world space; None where nothing is known of that: it is new,
    or has other triangles than before.
    """

    mesh: Mesh
    first_face: int
    before: Float64 | None


@dataclass(frozen=True)
class SceneMotion:
    """What has moved since the pictures from number `since` on up to the one before `picture`.

    moves: the meshes that are elsewhere, in the scene's order. changed: whether any has moved, come or gone.
    """

    picture: int
    since: int
    changed: bool
    moves: tuple[MeshMove, ...]


@dataclass(frozen=True)
class _Seen:
    positions: Float64
    triangles: Int32


class MeshPlaces:
    """Where the meshes were in the latest picture; kept over frames."""

    def __init__(self) -> None:
        self._seen: dict[MeshKey, _Seen] = {}
        self._picture = 0
        self._since = 0

    def advance(self, world: SceneSnapshot) -> SceneMotion:
        """What has moved up to a picture of `world`, in m; the next call compares with this one.

        Copies what has changed, so the snapshot's arrays need not live on. In the first picture all is as if it stood
        still, since nobody has seen it before.
        """
        moves, seen = [], {}
        first_face = 0
        for key, mesh in _keyed(world):
            known = self._seen.get(key)
            if known is not None and _same(known.positions, mesh.positions) and _same(known.triangles, mesh.triangles):
                seen[key] = known
            else:
                before = None if known is None or not _same(known.triangles, mesh.triangles) else known.positions
                if before is not None and len(before) != len(mesh.positions):
                    before = None
                moves.append(MeshMove(mesh, first_face, before))
                seen[key] = _Seen(mesh.positions.copy(), mesh.triangles.copy())
            first_face += len(mesh.triangles)
        changed = bool(moves) or len(seen) != len(self._seen)
        self._seen = seen
        self._picture += 1
        if changed:
            self._since = self._picture - 1
        is_first = self._picture == 1
        found = SceneMotion(self._picture, self._since, changed, () if is_first else tuple(moves))
        if changed:
            # The next picture is compared with this one and with none before it.
            self._since = self._picture
        return found

    def rest(self) -> SceneMotion:
        """Of one more picture of the scene that `advance` was last given."""
        self._picture += 1
        return SceneMotion(self._picture, self._since, False, ())


def _keyed(world: SceneSnapshot) -> Iterator[tuple[MeshKey, Mesh]]:
    counts: dict[str, int] = {}
    for mesh in world.meshes:
        if len(mesh.triangles):
            number = counts.get(mesh.name, 0)
            counts[mesh.name] = number + 1
            yield (mesh.name, number), mesh


def _same(one: np.ndarray, other: np.ndarray) -> bool:
    return one is other or np.array_equal(one, other)
