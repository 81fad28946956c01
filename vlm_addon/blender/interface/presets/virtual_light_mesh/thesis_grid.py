# SPDX-License-Identifier: GPL-3.0-or-later
"""The light grid of the thesis: cells with lists of the lights in range, nothing in the way of bounce light."""

import bpy

settings = bpy.context.scene.vlm

settings.technique = "vlm"
settings.samples = 1
settings.vlm_settings.lights = "range"
settings.vlm_settings.grid = 50
settings.vlm_settings.max_lights = 0
settings.vlm_settings.visibility = "none"
