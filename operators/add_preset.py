# SPDX-License-Identifier: GPL-3.0-or-later
"""Keep the scene's settings as a preset, or remove one."""

import bpy
from bl_operators.presets import AddPresetBase
from bpy.types import Operator

from ..vlm_addon.blender.interface import setting_presets


class VLM_OT_add_preset(AddPresetBase, Operator):  # noqa: N801 (Blender's naming of classes)
    """Keep the technique with its settings, the effects and the size of light meshes under a name"""

    bl_idname = "vlm.add_preset"
    bl_label = "Add Light Mesh Preset"
    bl_options = {"REGISTER"}  # noqa: RUF012 (a file is written, Blender's data stays: nothing to undo)
    preset_menu = "VLM_PT_presets"
    preset_subdir = setting_presets.FOLDER
    preset_defines = setting_presets.DEFINES

    name: bpy.props.StringProperty(name="Name", description="What the preset is called", maxlen=64)
    remove_name: bpy.props.BoolProperty(
        name="Remove", description="Remove the preset of this name instead", options={"SKIP_SAVE"}
    )
    remove_active: bpy.props.BoolProperty(
        name="Remove Active", description="Remove the preset that was chosen last instead", options={"SKIP_SAVE"}
    )

    @property
    def preset_values(self):
        return setting_presets.preset_values(bpy.context.scene)

    def execute(self, context):
        if not self.name.strip() and not self.remove_active:
            self.report({"ERROR"}, "The preset has no name: give it one")
            return {"CANCELLED"}
        result = super().execute(context)
        presets = f"presets: {', '.join(setting_presets.preset_names())}"
        if "FINISHED" in result:
            self.report({"INFO"}, f"There are {presets}")
        else:
            self.report({"WARNING"}, f"No preset was changed; {presets}")
        return result
