# SPDX-License-Identifier: GPL-3.0-or-later
"""Sums of all values before each one, on the device."""

from __future__ import annotations

import numpy as np
import pytest

from vlm_addon.render.buffer_pool import BufferPool
from vlm_addon.render.prefix_sum import PrefixSum


@pytest.mark.parametrize("count", [1, 63, 64, 65, 4096, 4097, 300_000])
def test_sums_of_all_before(device, count):
    values = np.random.default_rng(count).integers(0, 50, count).astype(np.uint32)
    with device.current() as context:
        prefix_sum = PrefixSum(context, device.shaders, BufferPool(context))
        buffer = context.buffer(values.tobytes())
        prefix_sum.run(buffer, count)
        found = np.frombuffer(buffer.read(), np.uint32)
    assert np.array_equal(found, np.concatenate(([0], np.cumsum(values[:-1]))))
