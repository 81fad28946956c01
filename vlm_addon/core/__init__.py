# SPDX-License-Identifier: GPL-3.0-or-later
"""Data and algorithms on numpy arrays. Imports neither bpy nor moderngl."""
