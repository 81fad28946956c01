# SPDX-License-Identifier: GPL-3.0-or-later
"""Sums of what comes before, on the device: in a fixed order, so the same on every run."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from .shader_library import ShaderLibrary, set_uniforms

if TYPE_CHECKING:
    import moderngl

    from .buffer_pool import BufferPool

INVOCATIONS = 64
"""Of a work group of the passes that take one value each."""
MAX_GROUPS_PER_AXIS = 65535
_VALUES_PER_RUN = 64
_BINDINGS = {"VALUE_BINDING": 0, "RUN_SUM_BINDING": 1}


def run_for_each(context: moderngl.Context, shader: moderngl.ComputeShader, count: int) -> None:
    """Runs groups of INVOCATIONS for `count` values, in rows of MAX_GROUPS_PER_AXIS, and lets what follows see it."""
    groups = -(-count // INVOCATIONS)
    if groups:
        wide = min(groups, MAX_GROUPS_PER_AXIS)
        shader.run(wide, -(-groups // wide))
        context.memory_barrier()


class PrefixSum:
    """Replaces each value of a buffer of uints by the sum of those before it."""

    def __init__(self, context: moderngl.Context, shaders: ShaderLibrary, pool: BufferPool) -> None:
        self._context = context
        self._pool = pool
        defines = {**_BINDINGS, "GROUP_SIZE": INVOCATIONS, "RUN": _VALUES_PER_RUN}
        self._shaders = {
            spread: shaders.compute("passes/light_grid_sum.comp", {**defines, "SPREAD": spread})
            for spread in (False, True)
        }

    def run(self, values: moderngl.Buffer, count: int) -> None:
        """values: the first `count` uints of it; their sum has to be less than 2^32."""
        runs = -(-count // _VALUES_PER_RUN)
        if runs == 1:
            with self._pool.uploaded(np.zeros(1, np.uint32)) as run_sums:
                self._sum_runs(True, values, run_sums, count)
            return
        with self._pool.take(4 * runs) as run_sums:
            self._sum_runs(False, values, run_sums, count)
            self.run(run_sums, runs)
            self._sum_runs(True, values, run_sums, count)

    def _sum_runs(self, spread: bool, values: moderngl.Buffer, run_sums: moderngl.Buffer, count: int) -> None:
        values.bind_to_storage_buffer(_BINDINGS["VALUE_BINDING"])
        run_sums.bind_to_storage_buffer(_BINDINGS["RUN_SUM_BINDING"])
        set_uniforms(self._shaders[spread], {"count": count})
        run_for_each(self._context, self._shaders[spread], -(-count // _VALUES_PER_RUN))
