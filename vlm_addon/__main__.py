# SPDX-License-Identifier: GPL-3.0-or-later
"""`python -m vlm_addon COMMAND …`: the command line with the bpy module or Blender's own Python."""

import sys

from .cli import main

sys.exit(main(sys.argv[1:]))
