# SPDX-License-Identifier: GPL-3.0-or-later
"""One file is one technique; `technique.technique_list` finds them."""
