# SPDX-License-Identifier: GPL-3.0-or-later
"""Tag ids and links in the open file."""
