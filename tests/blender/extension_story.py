# SPDX-License-Identifier: GPL-3.0-or-later
"""What a user does with the installed extension, step by step, in a Blender of its own.

Run by test_extension.py: `python -I extension_story.py ZIP FOLDER`. Writes FOLDER/story.json: what each step showed.
"""

import importlib.util
import json
import os
import sys
from pathlib import Path

import bpy
import numpy as np

MODULE = "bl_ext.user_default.virtual_light_mesh"
SIZE = 48
NATIVE = {"moderngl", "glcontext", "fast_simplification"}
STORY = {}


def step(function):
    """Run a step now and keep what it returns under its name."""
    STORY[function.__name__] = function()
    return function


def sentence_of(operator, **arguments):
    """The message with which an operator refuses, or "" where it does not."""
    try:
        operator(**arguments)
    except RuntimeError as error:
        return str(error)
    return ""


def room():
    """The default cube in a closed room with a red wall, lit by the default lamp brought inside."""
    bpy.ops.wm.read_homefile(use_factory_startup=True)
    bpy.ops.mesh.primitive_cube_add(size=1.0, location=(0.0, 0.0, 2.0))
    walls = bpy.context.object
    walls.name = "Room"
    walls.scale = (20.0, 20.0, 6.0)
    walls.data.flip_normals()
    red = bpy.data.materials.new("red")
    red.use_nodes = True
    red.node_tree.nodes["Principled BSDF"].inputs["Base Color"].default_value = (0.8, 0.05, 0.05, 1.0)
    walls.data.materials.append(red)
    bpy.data.objects["Light"].location = (1.0, -2.0, 4.0)
    scene = bpy.context.scene
    scene.world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0.0
    scene.render.resolution_x = scene.render.resolution_y = SIZE
    scene.render.resolution_percentage = 100
    scene.vlm.samples = 2


def light_meshes():
    return [thing.name for thing in bpy.context.scene.objects if "vlm_schema" in thing]


def lights():
    return sum(len(bpy.data.objects[name].data.polygons) for name in light_meshes())


def picture(name, engine):
    """(h, w, 4) float32 of a render, linear, as saved to an EXR file."""
    scene = bpy.context.scene
    scene.render.engine = engine
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.render.filepath = str(FOLDER / f"{name}.exr")
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(scene.render.filepath)
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    bpy.data.images.remove(image)
    return pixels.reshape(SIZE, SIZE, 4)


def main():
    @step
    def version():
        return bpy.app.version_string

    @step
    def install():
        bpy.ops.extensions.package_install_files(filepath=str(ZIP), repo="user_default", enable_on_install=True)
        return MODULE in bpy.context.preferences.addons

    @step
    def imports_of_native_modules():
        return sorted(NATIVE & set(sys.modules))

    @step
    def refusals():
        found = {}
        room()
        bpy.ops.object.select_all(action="DESELECT")
        found["nothing selected"] = sentence_of(bpy.ops.vlm.create_from_selection)
        found["no light mesh to check"] = sentence_of(bpy.ops.vlm.check)
        bpy.context.view_layer.objects.active = bpy.data.objects["Cube"]
        bpy.ops.object.mode_set(mode="EDIT")
        found["edit mode"] = sentence_of(bpy.ops.vlm.bake)
        bpy.ops.object.mode_set(mode="OBJECT")
        bpy.data.objects.remove(bpy.data.objects["Light"])
        found["no light"] = sentence_of(bpy.ops.vlm.light_scene)
        bpy.context.scene.camera = None
        found["no camera"] = sentence_of(bpy.ops.vlm.light_scene)
        bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
        found["empty scene"] = sentence_of(bpy.ops.vlm.bake)
        return found

    @step
    def unchanged_by_refusals():
        return not light_meshes() and bpy.context.scene.render.engine != "VLM_ENGINE"

    @step
    def create():
        room()
        bpy.ops.ed.undo_push(message="room")
        bpy.ops.object.select_all(action="SELECT")
        bpy.ops.vlm.create_from_selection("EXEC_DEFAULT", True, target_triangles=40)
        return {"light meshes": light_meshes(), "lights": lights(), "saved": bool(bpy.data.filepath)}

    @step
    def undo_and_redo():
        bpy.ops.ed.undo()
        undone = light_meshes()
        bpy.ops.ed.redo()
        return {"undone": undone, "redone": light_meshes(), "lights": lights()}

    @step
    def check():
        result = bpy.ops.vlm.check()
        return {"result": sorted(result), "findings": [item.text for item in bpy.context.scene.vlm.findings]}

    @step
    def counted_twice():
        bpy.ops.object.select_all(action="DESELECT")
        cube = bpy.data.objects["Cube"]
        cube.select_set(True)
        bpy.context.view_layer.objects.active = cube
        bpy.ops.vlm.create_from_selection(target_triangles=40)
        findings = [item.text for item in bpy.context.scene.vlm.findings]
        bpy.data.objects.remove(bpy.data.objects["VLM Cube"])
        return findings

    @step
    def f12():
        lit = picture("lit", "VLM_ENGINE")
        bpy.context.scene.vlm.technique = "direct"
        direct = picture("direct", "VLM_ENGINE")
        bpy.context.scene.vlm.technique = "vlm"
        bounce = lit[..., :3] - direct[..., :3]
        return {
            "lit": lit[..., :3].mean(axis=(0, 1)).tolist(),
            "direct": direct[..., :3].mean(axis=(0, 1)).tolist(),
            "least bounce": float(bounce.min()),
            "alpha": float(lit[..., 3].min()),
        }

    @step
    def light_grid():
        group, effects = bpy.context.scene.vlm.vlm_settings, bpy.context.scene.vlm.effects
        group.lights, group.range = "range", 0.0
        # Glossy surfaces show all virtual lights, whatever the diffuse sum leaves out.
        effects.screen_reflection = effects.light_mesh_reflection = effects.map_reflection = "off"
        dropped = picture("dropped", "VLM_ENGINE")
        effects.screen_reflection = effects.light_mesh_reflection = effects.map_reflection = "auto"
        group.lights = "tolerance"
        return float(dropped[..., :3].mean())

    @step
    def passes():
        settings = bpy.context.scene.render.image_settings
        if hasattr(settings, "media_type"):
            settings.media_type = "MULTI_LAYER_IMAGE"
        settings.file_format = "OPEN_EXR_MULTILAYER"
        bpy.context.scene.render.filepath = str(FOLDER / "layers.exr")
        bpy.ops.render.render(write_still=True)
        if hasattr(settings, "media_type"):
            settings.media_type = "IMAGE"
        header = (FOLDER / "layers.exr").read_bytes()[:4000]
        return [name for name in ("Combined", "Direct Light", "Indirect Light") if f"{name}.".encode() in header]

    @step
    def cancelled():
        (engine,) = (each for each in bpy.types.RenderEngine.__subclasses__() if each.__name__ == "VLM_RenderEngine")
        before = children()
        kept = engine._is_cancelled
        engine._is_cancelled = lambda self: True
        stopped = picture("cancelled", "VLM_ENGINE")
        engine._is_cancelled = kept
        again = picture("after_cancelled", "VLM_ENGINE")
        return {
            "cancelled": float(stopped[..., :3].mean()),
            "again": float(again[..., :3].mean()),
            "same process": before == children() != [],
        }

    @step
    def border():
        scene = bpy.context.scene
        whole = picture("whole", "VLM_ENGINE")
        scene.render.use_border = scene.render.use_crop_to_border = True
        scene.render.border_min_x, scene.render.border_max_x = 0.25, 0.75
        scene.render.border_min_y, scene.render.border_max_y = 0.5, 1.0
        scene.render.use_crop_to_border = False
        part = picture("part", "VLM_ENGINE")
        scene.render.use_border = False
        inside = np.zeros((SIZE, SIZE), bool)
        inside[SIZE // 2 :, SIZE // 4 : 3 * SIZE // 4] = True
        return {
            "inside": float(np.abs(part - whole)[inside].max()),
            "outside": float(np.abs(part)[~inside].max()),
        }

    @step
    def hidden_from_cycles():
        scene = bpy.context.scene
        scene.cycles.samples = 4
        scene.cycles.use_denoising = False
        with_light_mesh = picture("cycles_with", "CYCLES")
        for name in light_meshes():
            bpy.data.objects.remove(bpy.data.objects[name])
        without = picture("cycles_without", "CYCLES")
        return {"difference": float(np.abs(with_light_mesh - without).max()), "mean": float(without[..., :3].mean())}

    @step
    def no_light_mesh():
        fallback = picture("fallback", "VLM_ENGINE")
        return {"mean": fallback[..., :3].mean(axis=(0, 1)).tolist()}

    @step
    def light_scene():
        room()
        bpy.context.scene.render.filepath = ""
        result = bpy.ops.vlm.light_scene(target_triangles=40)
        return {"result": sorted(result), "engine": bpy.context.scene.render.engine, "lights": lights()}

    @step
    def bake():
        room()
        bpy.context.scene.render.resolution_percentage = 1  # below a pixel for whoever renders little to evaluate
        first = sorted(bpy.ops.vlm.bake(target_triangles=40))
        names = light_meshes()
        bpy.ops.vlm.bake(target_triangles=40)
        return {"result": first, "light meshes": names, "after a second bake": light_meshes()}

    @step
    def without_native_modules():
        room()
        bpy.context.scene.render.engine = "VLM_ENGINE"
        find_spec = importlib.util.find_spec
        importlib.util.find_spec = lambda name, *rest: None if name in NATIVE else find_spec(name, *rest)
        found = {
            "create": sentence_of(bpy.ops.vlm.bake),
            "light scene": sentence_of(bpy.ops.vlm.light_scene),
            "render": sentence_of(bpy.ops.render.render),
        }
        importlib.util.find_spec = find_spec
        return found

    @step
    def material_panel_is_shown():
        return "VLM_ENGINE" in bpy.types.EEVEE_MATERIAL_PT_surface.COMPAT_ENGINES

    @step
    def renderers():
        return children()

    @step
    def disable():
        bpy.ops.preferences.addon_disable(module=MODULE)
        return {
            "engine in panels": [
                panel.__name__
                for panel in bpy.types.Panel.__subclasses__()
                if "VLM_ENGINE" in getattr(panel, "COMPAT_ENGINES", ())
            ],
            "settings": hasattr(bpy.types.Scene, "vlm"),
            "classes": [name for name in dir(bpy.types) if name.startswith("VLM_")],
            "operators": dir(bpy.ops.vlm),
            "renderers": children(),
        }

    @step
    def enable_again():
        bpy.ops.preferences.addon_enable(module=MODULE)
        room()
        bpy.ops.vlm.bake(target_triangles=40)
        return {"lights": lights(), "mean": picture("again", "VLM_ENGINE")[..., :3].mean(axis=(0, 1)).tolist()}

    (FOLDER / "story.json").write_text(json.dumps(STORY, indent=1))


def children():
    """Command lines of the processes that this one has started and that still run."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rpartition(")")[2].split()
            command = (stat.parent / "cmdline").read_bytes().replace(b"\0", b" ").decode()
        except (FileNotFoundError, ProcessLookupError):
            continue
        if int(fields[1]) == os.getpid() and fields[0] != "Z":
            found.append(command)
    return found


if __name__ == "__main__":
    ZIP, FOLDER = Path(sys.argv[1]), Path(sys.argv[2])
    main()
