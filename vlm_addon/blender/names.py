# SPDX-License-Identifier: GPL-3.0-or-later
"""Names under which a virtual light mesh is stored in a .blend (the table in docs/architecture.md)."""

from __future__ import annotations

from typing import Any

COLLECTION = "Virtual Light Meshes"
NAME = "VLM"
"""What names of light meshes that we make begin with."""

SCHEMA_VERSION = 2
SCHEMA_PROPERTY = "vlm_schema"
STRENGTH_PROPERTY = "vlm_strength"
HUE_PROPERTY = "vlm_hue"
DYNAMIC_PROPERTY = "vlm_dynamic"
SOURCES_PROPERTY = "vlm_sources"
SOURCE_IDS_PROPERTY = "vlm_source_ids"
SOURCE_PLACES_PROPERTY = "vlm_source_places"
LINKS_PROPERTY = "vlm_links"
PAIRED_LINKS_PROPERTY = "vlm_paired_links"

COLOR_ATTRIBUTE = "vlm_color"
EMISSION_ATTRIBUTE = "vlm_emission"
TAG_ATTRIBUTE = "vlm_tag"
AREA_SCALE_ATTRIBUTE = "vlm_area_scale"
LOCK_ATTRIBUTE = "vlm_lock"
MARK_ATTRIBUTE = "vlm_mark"

ID_PROPERTY = "vlm_id"
TAG_PROPERTY = "vlm_tag"

MORE_DETAIL_GROUP = "VLM More"
NO_LIGHTS_GROUP = "VLM None"


def is_light_mesh(blender_object: Any) -> bool:
    """Whether an object (original or evaluated) is a virtual light mesh."""
    return SCHEMA_PROPERTY in blender_object
