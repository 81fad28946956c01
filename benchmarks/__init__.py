# SPDX-License-Identifier: GPL-3.0-or-later
"""Programs that print measured figures: `./dev bench NAME`."""
