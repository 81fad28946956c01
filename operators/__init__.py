# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender operators, one to a file, found by scan. They hold no algorithms: vlm_addon does the work."""

import importlib
import inspect
import pkgutil


def operator_classes() -> list[type]:
    """The Operator classes of all modules of this folder, in order of module name."""
    import bpy

    modules = [importlib.import_module(f".{info.name}", __name__) for info in pkgutil.iter_modules(__path__)]
    return [
        value
        for module in modules
        for _, value in inspect.getmembers(module, inspect.isclass)
        if issubclass(value, bpy.types.Operator) and value.__module__ == module.__name__
    ]
