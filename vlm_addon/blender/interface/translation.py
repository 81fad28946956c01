# SPDX-License-Identifier: GPL-3.0-or-later
"""The interface in the user's language, where there is a catalogue for it.

A catalogue is a module beside this one with the dictionaries OPERATORS, BUTTONS, LABELS and PROPERTIES, listed in
CATALOGUES under Blender's name of the language. Operators are named by their id, so that a tooltip may be worded anew
without all catalogues falling silent.
"""

from __future__ import annotations

from contextlib import ExitStack

import bpy

from . import german

OPERATOR_CONTEXT = "Operator"
DEFAULT_CONTEXT = "*"
CATALOGUES = {"de_DE": german}

Messages = dict[tuple[str, str], str]


def messages() -> dict[str, Messages]:
    """For each language: texts by context and English text, of the operators that are registered, as Blender wants."""
    found: dict[str, Messages] = {}
    for language, catalogue in CATALOGUES.items():
        texts = {(DEFAULT_CONTEXT, text): told for text, told in (catalogue.LABELS | catalogue.PROPERTIES).items()}
        texts |= {(OPERATOR_CONTEXT, text): told for text, told in catalogue.BUTTONS.items()}
        for name, (label, tooltip) in catalogue.OPERATORS.items():
            if hasattr(bpy.types, class_name(name)):
                operator = getattr(bpy.ops.vlm, name.split(".")[1]).get_rna_type()
                texts[OPERATOR_CONTEXT, operator.name] = label
                texts[DEFAULT_CONTEXT, operator.description] = tooltip
        found[language] = texts
    return found


def class_name(operator: str) -> str:
    """The name of an operator's class in bpy.types: VLM_OT_bake for vlm.bake."""
    return operator.upper().split(".")[0] + "_OT_" + operator.split(".")[1]


def register(undo: ExitStack) -> None:
    """Tell Blender the texts; `undo` hears how to take them back."""
    bpy.app.translations.register(__name__, messages())
    undo.callback(bpy.app.translations.unregister, __name__)
