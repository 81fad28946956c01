# SPDX-License-Identifier: GPL-3.0-or-later
"""One pass is one small file beside one shader of the same stem."""
