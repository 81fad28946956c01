# SPDX-License-Identifier: GPL-3.0-or-later
"""Help, and what to send along when something fails."""
