# SPDX-License-Identifier: GPL-3.0-or-later
"""What the operators do with the scene's light meshes, each function one step of theirs."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import wraps
from typing import Any, ParamSpec

import bpy
import numpy as np

from ..bake import Bake, BakeSettings, bake
from ..core.bake_key import surface_hashes
from ..core.counting import counted
from ..core.errors import InvalidInput, VlmError
from ..core.light_marks import creation_marks
from ..core.light_mesh import VirtualLightMesh
from ..core.progress import Progress
from ..core.scene import Finding, SceneSnapshot
from ..core.tag_pairs import without_automatic
from .baking.bake_state import set_made_from
from .engine import ENGINE_ID
from .extraction.extract import ExtractOptions, extract_scene, require_camera, require_lights
from .extraction.light_mesh_io import Extraction, LightOrigins, extract, origins_of
from .findings import list_findings
from .following import animation
from .interface.availability import has_geometry, light_mesh_objects, rendered_objects
from .interface.translation import told
from .light_faces import write_faces
from .light_history import light_history
from .light_meshes import is_local, readable_sources
from .locked_lights import kept_lights
from .names import LOCK_ATTRIBUTE, MARK_ATTRIBUTE, NAME
from .source_changes import phrases
from .tagging.source_faces import SourceFaces, read_source_faces
from .tagging.source_tags import faces_to_tag, received_tags, require_unchanged, write_face_tags
from .tagging.stored_links import mark_paired
from .target_light_mesh import find_replaced, unused_name
from .write_back import write_light_mesh

P = ParamSpec("P")

TAG_REGIONS = {
    "tag_regions": bpy.props.BoolProperty(
        name="Tag Regions",
        description="Let every face leave out just the lights that stand for it, by tags: no light on its own region "
        "at all, for some more time and memory in each picture",
        default=False,
    )
}
"""The property of operators that make light meshes of objects."""


@dataclass(frozen=True)
class Made:
    """A bake and where it goes: the scene's name, the light mesh's name and the objects that it was made from.

    name is None where the scene keeps the light meshes that it has, which are at `origins`. made_from: hashes of the
    surfaces, so that it can be told later whether they have changed. tagged: where new tags of them go, None without.
    locked: how many lights, the first, were kept. gone: names of objects that it is not made from any more.
    started: time.perf_counter() when the first of it was read.
    """

    bake: Bake
    scene: str
    name: str | None = None
    sources: tuple[str, ...] = ()
    origins: LightOrigins | None = None
    made_from: Mapping[str, str] = field(default_factory=dict)
    tagged: SourceFaces | None = None
    locked: int = 0
    gone: tuple[str, ...] = ()
    started: float = 0.0


def timed(begin: Callable[P, Callable[[Progress], Made]]) -> Callable[P, Callable[[Progress], Made]]:
    """`begin`, with what its work makes told when it began: reading is a part of it."""

    @wraps(begin)
    def begun(*values: P.args, **named: P.kwargs) -> Callable[[Progress], Made]:
        started = time.perf_counter()
        work = begin(*values, **named)
        return lambda progress: replace(work(progress), started=started)

    return begun


def from_selection(context: Any, settings: BakeSettings, tag_regions: bool = False) -> Callable[[Progress], Made]:
    """Work that makes a light mesh of the selected objects. tag_regions: as for `from_objects`."""
    things = [thing for thing in context.selected_objects if has_geometry(thing)]
    active = context.active_object
    named_after = active if active in things else things[0]
    return _in_its_place(things, f"{NAME} {named_after.name}", settings, tag_regions)


def from_collection(collection: Any, settings: BakeSettings, tag_regions: bool = False) -> Callable[[Progress], Made]:
    """Work that makes a light mesh of the objects of a collection and of those in it.

    Raises InvalidInput where none of them shows a surface in renders.
    """
    things = [thing for thing in collection.all_objects if has_geometry(thing) and not thing.hide_render]
    if not things:
        problem = "none of its objects shows a surface in renders"
        raise InvalidInput(f"collection {collection.name!r}", problem, "put meshes into it, or choose another")
    return _in_its_place(things, f"{NAME} {collection.name}", settings, tag_regions)


def from_scene(context: Any, settings: BakeSettings, tag_regions: bool = False) -> Callable[[Progress], Made]:
    """Work that makes one light mesh of all that the scene shows, whatever light meshes it has."""
    things = [thing for thing in rendered_objects(context) if has_geometry(thing)]
    return _in_its_place(things, NAME, settings, tag_regions)


def _in_its_place(
    things: list[Any], name: str, settings: BakeSettings, tag_regions: bool
) -> Callable[[Progress], Made]:
    """`from_objects` into the light mesh that stands for them already, around its locked lights, or into a new one.

    Raises InvalidInput where more lights are locked than are asked for.
    """
    replaced = find_replaced(things, name, bpy.context.scene)
    if replaced is None:
        return from_objects(things, unused_name(name), settings, tag_regions)
    keep = kept_lights(replaced, settings.target_triangles) if is_local(replaced) else None
    return from_objects(things, replaced.name, settings, tag_regions, keep)


@timed
def from_objects(
    things: list[Any],
    name: str,
    settings: BakeSettings,
    tag_regions: bool,
    keep: VirtualLightMesh | None = None,
    gone: tuple[str, ...] = (),
) -> Callable[[Progress], Made]:
    """Work that makes the light mesh `name` of objects.

    tag_regions: let each face leave out just the lights that stand for it, as the simplification knows them. keep:
    lights that stay as they are. gone: names of objects that it was made from and is not any more.
    """
    sources = tuple(thing.name for thing in things)
    options = ExtractOptions(objects=frozenset(sources))
    if not tag_regions:
        return _work(extract_scene(options), name, sources, settings, None, keep, gone)
    tagged = read_source_faces(options).by_face()
    return _work(tagged.snapshot, name, sources, settings, tagged, keep, gone)


@timed
def from_visible_scene(context: Any, settings: BakeSettings) -> Callable[[Progress], Made]:
    """Work that makes a light mesh of the visible scene where it has none, and checks the one it has."""
    return _work_on_scene(context, extract(), settings)


@timed
def from_lit_scene(context: Any, settings: BakeSettings) -> Callable[[Progress], Made]:
    """The same for a scene that is about to be rendered. Raises InvalidInput where nothing in it sends out light."""
    found = extract()
    require_camera(found.snapshot)
    require_lights(found.snapshot)
    return _work_on_scene(context, found, settings)


def from_snapshot(context: Any, snapshot: SceneSnapshot, settings: BakeSettings) -> Callable[[Progress], Made]:
    """Work that makes one light mesh of all that the scene shows, which is `snapshot`."""
    sources = tuple(thing.name for thing in rendered_objects(context) if has_geometry(thing))
    return _work(snapshot, NAME, sources, settings)


def _work_on_scene(context: Any, found: Extraction, settings: BakeSettings) -> Callable[[Progress], Made]:
    snapshot, existing = found.snapshot, found.light_mesh
    if existing is None:
        return from_snapshot(context, snapshot, settings)
    history = light_history(context.scene, found)
    return lambda progress: Made(
        bake(snapshot, existing, None, progress, history=history), snapshot.name, origins=found.origins
    )


def _work(
    snapshot: SceneSnapshot,
    name: str,
    sources: tuple[str, ...],
    settings: BakeSettings,
    tagged: SourceFaces | None = None,
    keep: VirtualLightMesh | None = None,
    gone: tuple[str, ...] = (),
) -> Callable[[Progress], Made]:
    locked = len(keep) if keep is not None else 0
    kept = () if keep is None else (keep.tag_ids, keep.links[np.isin(keep.links[:, 0], keep.tag_ids)])
    scene = bpy.data.scenes[snapshot.name]
    replaced = next((thing for thing in light_mesh_objects(scene) if thing.name == name), None)
    faces = faces_to_tag(tagged, scene, replaced, kept) if tagged is not None else None
    received = received_tags()
    plain = replace(snapshot, meshes=tuple(without_automatic(mesh, received) for mesh in snapshot.meshes))

    def work(progress: Progress) -> Made:
        made = bake(plain, None, settings, progress, faces, keep)
        hashes = surface_hashes(plain.meshes)
        return Made(made, snapshot.name, name, sources, made_from=hashes, tagged=tagged, locked=locked, gone=gone)

    return work


def write(made: Made) -> str:
    """Put what was made into Blender's data, with its findings; returns a sentence with counts."""
    scene = require_scene(made.scene)
    twice = _counted_twice(scene, made)
    findings = (*twice, *made.bake.findings)
    count = lights(len(made.bake.light_mesh))
    if made.name is None or made.bake.creation is None:
        list_findings(scene, findings, made.origins)
        return f"Kept the {count} that the scene has"
    if made.tagged is not None and made.bake.face_tags is not None:
        require_unchanged(made.tagged, made.bake.face_tags)
    followed = animation.followed_by(made.name, scene)
    place = _place(made, scene)
    written = write_light_mesh(made.bake.light_mesh, made.name, made.sources, scene)
    if made.tagged is not None and made.bake.face_tags is not None:
        write_face_tags(made.tagged, made.bake.face_tags)
    if made.bake.paired_links is not None:
        mark_paired(written, made.bake.paired_links)
    if made.locked:
        write_faces(written, LOCK_ATTRIBUTE, np.arange(len(made.bake.light_mesh)) < made.locked)
    write_faces(written, MARK_ATTRIBUTE, creation_marks(made.bake.light_mesh))
    set_made_from(written, made.made_from)
    list_findings(scene, findings, origins_of(written))
    again = animation.follow_again(written, followed, bpy.context)
    seconds = time.perf_counter() - made.started
    missing = phrases(made.gone, [name for name in made.sources if name not in made.made_from])
    unseen = _unseen(written, scene)
    notes = "".join(f"; {note}" for note in (*missing, *(finding.problem for finding in twice), *unseen))
    triangles = counted(made.bake.creation.source_triangles, "triangle")
    return f"Made {count} from {triangles} in {seconds:.1f} s{place}{again}{notes}"


def _place(made: Made, scene: Any) -> str:
    """What to say of the lights that are replaced."""
    before = next((thing for thing in light_mesh_objects(scene) if thing.name == made.name), None)
    if before is None:
        return ""
    kept = f"; {lights(made.locked)} of them locked and kept" if made.locked else ""
    return f", in place of the {faces(len(before.data.polygons))} of {before.name}{kept}"


def _unseen(written: Any, scene: Any) -> list[str]:
    """What to say of lights that no view layer of the scene has: they light nothing."""
    homes = set(written.users_collection)
    if any(_shows(layer.layer_collection, homes) for layer in scene.view_layers):
        return []
    name = next(iter(written.users_collection)).name
    return [f"collection {name!r} is excluded from the view layer, so they light nothing: tick it in the Outliner"]


def _shows(part: Any, homes: set[Any]) -> bool:
    """Whether a part of a view layer's tree has one of these collections; its list of objects is not up to date yet."""
    if part.exclude:
        return False
    return part.collection in homes or any(_shows(child, homes) for child in part.children)


def _counted_twice(scene: Any, made: Made) -> list[Finding]:
    """A finding for each light mesh of the scene that stands for some of the same objects."""
    findings = []
    for other in light_mesh_objects(scene):
        known = {source.name for source in readable_sources(other, scene) if source is not None}
        shared = sorted(set(made.sources) & known)
        if shared and other.name != made.name:
            which = f"{shared[0]!r} and {len(shared) - 1} more have" if len(shared) > 1 else f"{shared[0]!r} has"
            problem = f"{which} bounce light in {other.name!r} already, so it counts twice"
            findings.append(Finding(f"light mesh {made.name!r}", problem, "delete one of the two light meshes"))
    return findings


def require_scene(name: str) -> Any:
    """The scene of that name. Raises InvalidInput where it is gone."""
    scene = bpy.data.scenes.get(name)
    if scene is None:
        raise InvalidInput(f"scene {name!r}", "it is gone", "undo, or do it again in another scene")
    return scene


def render_picture(context: Any) -> None:
    """Render the scene by our engine: beside the window that shows the picture, or at once where there is no window.

    The window is opened after the operator that asks for it has ended: while it opens, Blender handles events, and
    would call the modal operator again from within.
    """
    context.scene.render.engine = ENGINE_ID
    if not bpy.app.background:
        bpy.app.timers.register(render_in_window)
        return
    try:
        bpy.ops.render.render()
    except RuntimeError as error:
        raise VlmError(str(error).strip()) from error


def render_in_window() -> None:
    """Timer callback: F12 in the first window whose scene uses our engine."""
    for window in bpy.context.window_manager.windows:
        if window.scene.render.engine == ENGINE_ID:
            with bpy.context.temp_override(window=window):
                bpy.ops.render.render("INVOKE_DEFAULT")
            return


def allow(operator: Any, problem: str | None) -> bool:
    """What `poll` returns; a problem becomes the tooltip of the disabled button."""
    if problem is not None:
        operator.poll_message_set(told(problem))
    return problem is None


def lights(count: int) -> str:
    """A number of virtual lights in words."""
    return counted(count, "virtual light")


def faces(count: int) -> str:
    """A number of faces in words."""
    return counted(count, "face")


def counted_findings(count: int) -> str:
    """A number of findings in words."""
    return counted(count, "finding")
