# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender's scene as arrays: meshes, materials, lamps, world, light meshes."""

import bpy  # noqa: F401 (outside Blender, mathutils exists once this has been imported)
