# SPDX-License-Identifier: GPL-3.0-or-later
"""The renderer: snapshot in, images out, through OpenGL 4.3. Imports no bpy."""
