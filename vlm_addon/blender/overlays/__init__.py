# SPDX-License-Identifier: GPL-3.0-or-later
"""What the 3D views show of light meshes."""
