# SPDX-License-Identifier: GPL-3.0-or-later
"""Virtual Light Meshes: artist-authored bounce light, as a library that needs no Blender to import."""
