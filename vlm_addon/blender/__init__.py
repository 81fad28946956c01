# SPDX-License-Identifier: GPL-3.0-or-later
"""The Blender bridge: the only code that reads or writes bpy data."""
