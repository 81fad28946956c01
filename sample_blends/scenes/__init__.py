# SPDX-License-Identifier: GPL-3.0-or-later
"""The sample scenes, one module each, on two helpers: `shapes` (numpy geometry) and `blend` (Blender objects)."""
