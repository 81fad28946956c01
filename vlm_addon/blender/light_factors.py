# SPDX-License-Identifier: GPL-3.0-or-later
"""The factors on all lights of a light mesh, as custom properties that Blender shows with units and a colour field."""

from __future__ import annotations

from typing import Any

from .light_meshes import is_local
from .names import HUE_PROPERTY, STRENGTH_PROPERTY

NEUTRAL_STRENGTH = 1.0
NEUTRAL_HUE = (1.0, 1.0, 1.0)
MOST_BY_SLIDER = 10.0


def set_neutral_factors(thing: Any) -> None:
    """Give a new light mesh factors that change nothing."""
    thing[STRENGTH_PROPERTY] = NEUTRAL_STRENGTH
    thing[HUE_PROPERTY] = NEUTRAL_HUE
    describe_factors(thing)


def describe_factors(thing: Any) -> None:
    """Tell Blender how to show the factors that a light mesh of this file has."""
    if not is_local(thing):
        return
    if STRENGTH_PROPERTY in thing:
        text = "Factor on what all lights of this light mesh send out: 5 makes the bounce five times as strong"
        looks = thing.id_properties_ui(STRENGTH_PROPERTY)
        looks.update(min=0.0, soft_max=MOST_BY_SLIDER, default=NEUTRAL_STRENGTH, description=text)
    if HUE_PROPERTY in thing:
        text = "Factor on each channel of all lights of this light mesh; white changes nothing"
        looks = thing.id_properties_ui(HUE_PROPERTY)
        looks.update(min=0.0, soft_max=1.0, subtype="COLOR", default=NEUTRAL_HUE, description=text)
