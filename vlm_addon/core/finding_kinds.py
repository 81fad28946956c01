# SPDX-License-Identifier: GPL-3.0-or-later
"""The words in `Finding.kind` of what the check finds in a light mesh (validate.py) and repairs (repair.py)."""

from __future__ import annotations

EMPTY = "empty"
NOT_FINITE = "not_finite"
NEGATIVE = "negative"
BAD_SAMPLES = "bad_samples"
DEGENERATE = "degenerate"
NON_MANIFOLD = "non_manifold"
UNSAMPLED = "unsampled"
INSIDE_OUT = "inside_out"
IN_FRONT = "in_front"
THIN = "thin"
TWO_SIDED = "two_sided"
OVERLAPPING = "overlapping"
BRIGHT = "bright"
LOST_TAG = "lost_tag"

BROKEN = frozenset({NOT_FINITE, NEGATIVE, BAD_SAMPLES})
"""Kinds with which nothing else can be judged."""
