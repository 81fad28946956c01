# SPDX-License-Identifier: GPL-3.0-or-later
"""Accuracy against time: error maps, comparisons and reports. Imports no bpy."""
