# SPDX-License-Identifier: GPL-3.0-or-later
"""Tools that draw lights on visible surfaces."""
