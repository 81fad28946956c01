# SPDX-License-Identifier: GPL-3.0-or-later
"""What a light mesh and a light grid depend on, as hashes of content, and what has changed since, in words.

Light itself is no part of it: lamps, the world and the colours of virtual lights may change without a new bake. What
moves by itself (`dynamic`) is compared by all but its place: it is somewhere else in every frame.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

from .array_codec import content_hash
from .errors import InvalidInput
from .light_mesh import VirtualLightMesh
from .scene import Mesh

DIGITS = 16
"""Of a hash: 64 bits tell a scene's surfaces apart."""
NOT_MADE_FROM = {"name", "owner", "corner_normals", "corner_uvs", "corner_colors", "material_indices", "tag_ids"}
"""Fields of Mesh that lights are not made from: what looks mean is in `reflectance` and `emission`, and tags say which
lights a surface leaves out when there are lights."""
LIGHT_ALONE = {"colour", "emission", "strength", "samples"}
"""Fields of VirtualLightMesh that a light grid does not depend on."""
NAMED = 3
"""Changes that a sentence names one by one."""


@dataclass(frozen=True)
class BakeKey:
    """surfaces: hash by name of object. lights, settings: hashes; "" where they do not count."""

    surfaces: Mapping[str, str]
    lights: str = ""
    settings: str = ""

    def to_json(self) -> dict[str, Any]:
        """As JSON holds it."""
        return {"surfaces": dict(self.surfaces), "lights": self.lights, "settings": self.settings}

    @classmethod
    def from_json(cls, tree: Any, owner: str) -> BakeKey:
        """What `to_json` gave. Raises InvalidInput, naming `owner`, for anything else."""
        texts = isinstance(tree, dict) and isinstance(tree.get("surfaces"), dict)
        if not texts or not all(
            isinstance(text, str) for text in (*tree["surfaces"].values(), tree.get("lights"), tree.get("settings"))
        ):
            raise InvalidInput(owner, "what it was made from cannot be read", "make it again")
        return cls(dict(tree["surfaces"]), tree["lights"], tree["settings"])


def surface_hashes(meshes: Iterable[Mesh]) -> dict[str, str]:
    """Hash of each visible object, the instances of one instancer together, by name."""
    parts: dict[str, list[str]] = {}
    for mesh in meshes:
        left_out = NOT_MADE_FROM | {"positions"} if mesh.dynamic else NOT_MADE_FROM
        owner = mesh.owner or mesh.name.split("/")[0]
        parts.setdefault(owner, []).append(_hash(mesh, left_out))
    return {name: found[0] if len(found) == 1 else _short(found) for name, found in parts.items()}


def light_hash(light_mesh: VirtualLightMesh) -> str:
    """Hash of where the lights are that do not move, and of the number, tags and links of all."""
    still = light_mesh.subset(~light_mesh.dynamic)
    return _short([_hash(still, LIGHT_ALONE), light_mesh.dynamic, light_mesh.tag_ids, light_mesh.links])


def grid_key(meshes: Iterable[Mesh], light_mesh: VirtualLightMesh, settings: Any) -> BakeKey:
    """What a light grid of these lights over these surfaces depends on; settings: its dataclass."""
    return BakeKey(surface_hashes(meshes), light_hash(light_mesh), _short(settings))


def grid_changes(before: BakeKey, now: BakeKey) -> tuple[str, ...]:
    """What of a light grid is out of date, in phrases; none where it is as it would be now."""
    found = []
    if before.lights != now.lights:
        found.append("the places or tags of virtual lights changed")
    if before.settings != now.settings:
        found.append("the light grid's settings changed")
    new = sorted(now.surfaces.keys() - before.surfaces.keys())
    return (*found, *surface_changes(before.surfaces, now.surfaces), *_phrase(new, "is new", "are new"))


def surface_changes(before: Mapping[str, str], now: Mapping[str, str]) -> tuple[str, ...]:
    """Which of the surfaces `before` have changed or are gone, in phrases."""
    gone = sorted(before.keys() - now.keys())
    changed = sorted(name for name in before.keys() & now.keys() if before[name] != now[name])
    return (*_phrase(changed, "changed", "changed"), *_phrase(gone, "is gone", "are gone"))


def _phrase(names: Sequence[str], one: str, several: str) -> list[str]:
    if not names:
        return []
    listed = ", ".join(repr(name) for name in names[:NAMED])
    more = f" and {len(names) - NAMED} more" if len(names) > NAMED else ""
    return [f"{listed}{more} {one if len(names) == 1 else several}"]


def _hash(value: Any, left_out: set[str]) -> str:
    names = sorted(field.name for field in fields(value) if field.name not in left_out)
    return _short({name: getattr(value, name) for name in names})


def _short(value: Any) -> str:
    return content_hash(value)[:DIGITS]
