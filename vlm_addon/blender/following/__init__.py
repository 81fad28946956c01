# SPDX-License-Identifier: GPL-3.0-or-later
"""Light meshes that move and deform with their sources."""
