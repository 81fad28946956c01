# SPDX-License-Identifier: GPL-3.0-or-later
"""What the panels of the sidebar share."""

from __future__ import annotations

import textwrap
from typing import Any

from .translation import OWN_CONTEXT, told

CATEGORY = "VLM"
PIXELS_PER_CHARACTER = 7
LEAST_CHARACTERS = 12
ICON_CHARACTERS = 5
LABEL_SHARE = 0.38


class SidebarPanel:
    """Where the panels of this extension are: a tab of the 3D view's sidebar."""

    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = CATEGORY
    bl_translation_context = OWN_CONTEXT


def labelled(layout: Any, owner: Any, name: str, label_share: float = LABEL_SHARE) -> None:
    """A property with its label beside it: a plain menu in a narrow sidebar cuts its label off."""
    split = layout.split(factor=label_share)
    split.label(text=told(owner.bl_rna.properties[name].name))
    split.prop(owner, name, text="")


def hint(layout: Any, context: Any, sentence: str | None) -> None:
    """A sentence in as many lines as it takes; nothing for None."""
    if sentence:
        wrapped(layout.column(align=True), context, sentence, "INFO")


def wrapped(layout: Any, context: Any, sentence: str, icon: str) -> None:
    """A sentence, translated, broken to the width of the sidebar, with an icon before its first line."""
    width = context.region.width / (context.preferences.system.ui_scale * PIXELS_PER_CHARACTER)
    lines = textwrap.wrap(told(sentence), max(int(width) - ICON_CHARACTERS, LEAST_CHARACTERS))
    for number, line in enumerate(lines):
        layout.label(text=line, icon=icon if number == 0 else "BLANK1", translate=False)
