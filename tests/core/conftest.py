# SPDX-License-Identifier: GPL-3.0-or-later
"""No example has to be ready in time: a busy machine is no fault of the code."""

from hypothesis import settings

settings.register_profile("no deadline", deadline=None)
settings.load_profile("no deadline")
