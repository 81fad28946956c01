# SPDX-License-Identifier: GPL-3.0-or-later
"""Calls functions of `gpu_shaders/lib` on arrays: a small compute shader evaluates one expression for each row."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import count

import numpy as np

from vlm_addon.render.device import Device

GROUP_SIZE = 64
_TYPES = {1: "float", 2: "vec2", 3: "vec3", 4: "vec4"}
_INPUT_BINDING, _OUTPUT_BINDING = 7, 8
_names = count()


def evaluate(
    device: Device,
    include: str | Sequence[str],
    expression: str,
    inputs: Mapping[str, np.ndarray],
    components: int = 1,
    preamble: str = "",
    defines: Mapping[str, int] | None = None,
) -> np.ndarray:
    """float32 (n,) or (n, components): `expression` for each row of `inputs`.

    include: file or files under `gpu_shaders/`. inputs: by the name that `expression` uses, (n,) for a float or an
    int (int32 arrays become int), (n, 2..4) for a vector. preamble: GLSL at file scope. defines: what the
    files need besides the constants that all shaders see.
    """
    columns, declarations, width = [], [], 0
    for name, values in inputs.items():
        values = np.atleast_1d(values)
        column = values.reshape(len(values), -1)
        size = column.shape[1]
        parts = ", ".join(f"inputs[row + {width + i}]" for i in range(size))
        if column.dtype == np.int32:
            declarations.append(f"int {name} = floatBitsToInt({parts});")
            columns.append(column.view(np.float32))
        else:
            declarations.append(f"{_TYPES[size]} {name} = {_TYPES[size]}({parts});")
            columns.append(column.astype(np.float32))
        width += size
    rows = len(columns[0])
    packed = np.ascontiguousarray(np.concatenate(columns, axis=1))
    includes = [include] if isinstance(include, str) else list(include)
    outputs = "\n".join(
        f"outputs[{components} * index + {i}] = result{_component(i, components)};" for i in range(components)
    )
    text = "\n".join(
        [
            *(f'#include "{path}"' for path in includes),
            preamble,
            f"layout(local_size_x = {GROUP_SIZE}) in;",
            f"layout(std430, binding = {_INPUT_BINDING}) readonly buffer Inputs {{ float inputs[]; }};",
            f"layout(std430, binding = {_OUTPUT_BINDING}) writeonly buffer Outputs {{ float outputs[]; }};",
            "uniform uint rows; void main() { uint index = gl_GlobalInvocationID.x; if (index >= rows) { return; }",
            f"uint row = index * {width}u;",
            *declarations,
            f"{_TYPES[components]} result = {expression};",
            outputs,
            "}",
        ]
    )
    with device.current() as context:
        shader = device.shaders.compute_from_text(text, f"shader function {next(_names)}", defines)
        source = context.buffer(packed.tobytes())
        target = context.buffer(reserve=4 * components * rows)
        source.bind_to_storage_buffer(_INPUT_BINDING)
        target.bind_to_storage_buffer(_OUTPUT_BINDING)
        shader["rows"] = rows
        shader.run((rows + GROUP_SIZE - 1) // GROUP_SIZE)
        context.finish()
        result = np.frombuffer(target.read(), np.float32)
    return result if components == 1 else result.reshape(rows, components)


def _component(index: int, components: int) -> str:
    return "" if components == 1 else "." + "xyzw"[index]
