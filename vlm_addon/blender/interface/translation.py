# SPDX-License-Identifier: GPL-3.0-or-later
"""The interface in the user's language, where there is a catalogue for it.

A catalogue is a module beside this one with the dictionaries OPERATORS, BUTTONS, LABELS, PROPERTIES, SENTENCES and
FINDINGS, listed in CATALOGUES under Blender's name of the language. Operators are named by their id, so that a tooltip
may be worded anew without all catalogues falling silent.

Where Blender has a word of its own, it shows that: Tags would be those of a shop. So all is also told under a context
of ours.
"""

from __future__ import annotations

from contextlib import ExitStack

import bpy

from . import german

OPERATOR_CONTEXT = "Operator"
DEFAULT_CONTEXT = "*"
OWN_CONTEXT = "VLM"
FINDING = "Finding: "
CATALOGUES = {"de_DE": german}

Messages = dict[tuple[str, str], str]


def messages() -> dict[str, Messages]:
    """For each language: texts by context and English text, of the operators that are registered, as Blender wants."""
    found: dict[str, Messages] = {}
    for language, catalogue in CATALOGUES.items():
        texts = {(DEFAULT_CONTEXT, text): told for text, told in (catalogue.LABELS | catalogue.PROPERTIES).items()}
        texts |= {(DEFAULT_CONTEXT, text): told for text, told in catalogue.SENTENCES.items()}
        texts |= {(OWN_CONTEXT, text): told for (_, text), told in list(texts.items())}
        texts |= {(OPERATOR_CONTEXT, text): told for text, told in catalogue.BUTTONS.items()}
        texts |= {(OWN_CONTEXT, FINDING + kind): told for kind, told in catalogue.FINDINGS.items()}
        for name, (label, tooltip) in catalogue.OPERATORS.items():
            if hasattr(bpy.types, class_name(name)):
                operator = getattr(bpy.ops.vlm, name.split(".")[1]).get_rna_type()
                texts[OPERATOR_CONTEXT, operator.name] = label
                texts[DEFAULT_CONTEXT, operator.description] = tooltip
        found[language] = texts
    return found


def told(text: str) -> str:
    """A text of ours in the user's language; as it is where there is none for it."""
    return str(bpy.app.translations.pgettext_iface(text, OWN_CONTEXT))


def told_finding(kind: str, text: str, count: int) -> str:
    """A finding of the check in the user's language, with the number of faces that it names; else its own text."""
    key = FINDING + kind
    sentence = told(key)
    return text if sentence == key else sentence.format(count=count)


def class_name(operator: str) -> str:
    """The name of an operator's class in bpy.types: VLM_OT_bake for vlm.bake."""
    return operator.upper().split(".")[0] + "_OT_" + operator.split(".")[1]


def register(undo: ExitStack) -> None:
    """Tell Blender the texts; `undo` hears how to take them back."""
    bpy.app.translations.register(__name__, messages())
    undo.callback(bpy.app.translations.unregister, __name__)
