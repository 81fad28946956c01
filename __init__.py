# SPDX-License-Identifier: GPL-3.0-or-later
"""Virtual Light Mesh: the Blender extension. Everything that needs bpy is imported when Blender registers it."""


def register() -> None:
    """Add the operators, panels, properties, render engine and command line to Blender."""
    from . import operators
    from .vlm_addon.blender import registration

    registration.register(operators.operator_classes())


def unregister() -> None:
    """Take out all that `register` added and end the renderer's process."""
    from .vlm_addon.blender import registration

    registration.unregister()
