# SPDX-License-Identifier: GPL-3.0-or-later
"""A rough picture in the least time."""

import bpy

settings = bpy.context.scene.vlm

settings.technique = "vlm"
settings.samples = 1
settings.world_lights = 16
settings.target_triangles = 300
settings.vlm_settings.lights = "tolerance"
settings.vlm_settings.tolerance = 0.05
settings.vlm_settings.visibility = "none"
