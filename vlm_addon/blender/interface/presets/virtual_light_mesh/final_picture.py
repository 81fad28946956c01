# SPDX-License-Identifier: GPL-3.0-or-later
"""Smooth edges and soft shadows; walls stand in the way of bounce light."""

import bpy

settings = bpy.context.scene.vlm

settings.technique = "vlm"
settings.samples = 64
settings.world_lights = 128
settings.target_triangles = 3000
settings.vlm_settings.lights = "tolerance"
settings.vlm_settings.tolerance = 0.01
settings.vlm_settings.visibility = "octree"
settings.vlm_settings.visibility_rays = 8
