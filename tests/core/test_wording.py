# SPDX-License-Identifier: GPL-3.0-or-later
"""What users read is in American English, as Blender's interface is; names and comments are the code's own."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("vlm_addon", "operators")
BRITISH = re.compile(r"colour|\bgrey|centre\b|metres?\b|neighbour|behaviour|favour|licence\b|licences\b", re.IGNORECASE)
NAME = re.compile(r"[\w.]+")
SHADER = re.compile(r"[;{}]\n")
CATALOGUE = "german.py"


def unspoken(tree: ast.AST) -> set[int]:
    """Constants that nobody is shown: docstrings and strings that stand by themselves, but for those of operators."""
    found = set()
    for node in ast.walk(tree):
        spoken = isinstance(node, ast.ClassDef) and "_OT_" in node.name
        for number, each in enumerate(
            getattr(node, "body", ()) if not isinstance(node, ast.Lambda | ast.IfExp) else ()
        ):
            if isinstance(each, ast.Expr) and isinstance(each.value, ast.Constant) and not (spoken and number == 0):
                found.add(id(each.value))
    return found


def spoken_texts() -> Iterator[tuple[str, str]]:
    """(place, text) of all sentences in the add-on."""
    for folder in FOLDERS:
        for path in sorted((ROOT / folder).rglob("*.py")):
            if path.name == CATALOGUE:
                continue
            tree = ast.parse(path.read_text(encoding="utf-8"))
            left_out = unspoken(tree)
            for node in ast.walk(tree):
                is_text = isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in left_out
                if is_text and not NAME.fullmatch(node.value) and not SHADER.search(node.value):
                    yield f"{path.relative_to(ROOT)}:{node.lineno}", node.value


def test_users_read_american_english() -> None:
    texts = list(spoken_texts())
    assert len(texts) > 1000
    assert [(place, text) for place, text in texts if BRITISH.search(text)] == []
