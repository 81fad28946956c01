# SPDX-License-Identifier: GPL-3.0-or-later
"""Numbers as text, and back."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vlm_addon.core.errors import InvalidInput
from vlm_addon.core.spans import numbers_in, parse_spans, spans_text


@given(st.sets(st.integers(0, 200)))
def test_text_made_of_numbers_names_the_same_numbers(numbers):
    assert set(numbers_in(parse_spans(spans_text(sorted(numbers)), "light", 0)).tolist()) == numbers


def test_neighbours_are_written_as_a_span():
    assert spans_text(np.array([7, 3, 4, 5, 5, 9])) == "3-5, 7, 9"


@pytest.mark.parametrize("text", ["a", "3-", "-3", "5-3", "1.5", "0"])
def test_what_is_no_number_is_named(text):
    with pytest.raises(InvalidInput, match=r"lights: .* is no light; give numbers from 1"):
        parse_spans(text, "light", 1)
