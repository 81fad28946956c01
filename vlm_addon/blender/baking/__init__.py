# SPDX-License-Identifier: GPL-3.0-or-later
"""What is baked, where it lives and whether it is up to date."""
