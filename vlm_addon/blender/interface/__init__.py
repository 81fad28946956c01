# SPDX-License-Identifier: GPL-3.0-or-later
"""Panels, menus, presets and words of the interface."""
