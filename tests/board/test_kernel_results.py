"""What kernels have computed: when it is known, and that nobody can change it."""

from __future__ import annotations

from operator import attrgetter
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from kernels_for_tests import Counting, read_only

from reconros_zenoh.board.kernel_results import KernelResults, computed

if TYPE_CHECKING:
    from collections.abc import Callable

WAYS = pytest.mark.parametrize("way", [computed, KernelResults(9).of], ids=["now", "unless known"])

GRID = np.arange(6, dtype=np.uint32).reshape(2, 3)


@pytest.mark.parametrize(
    "other",
    [
        pytest.param(GRID + 1, id="content"),
        pytest.param(GRID.reshape(3, 2), id="shape"),
        pytest.param(GRID.view(np.int32), id="type"),
        pytest.param(GRID.T, id="order"),
        pytest.param(np.empty((0, 3), np.uint32), id="empty"),
        pytest.param(7, id="number"),
    ],
)
def test_an_array_that_differs_is_computed_anew(other: Any) -> None:
    results = KernelResults(9)
    kernel = Counting(np.shape)
    assert results.of(kernel, GRID) == (2, 3)
    assert results.of(kernel, other) == np.shape(other)
    assert kernel.calls == 2


def test_arrays_with_other_fields_are_different_arguments() -> None:
    results = KernelResults(9)
    kind_of = attrgetter("dtype")  # one kernel
    for name, kind in (("x", np.uint32), ("y", np.uint32), ("y", np.float32)):
        assert results.of(kind_of, GRID.view([(name, kind)])) == np.dtype([(name, kind)])


def test_equal_arrays_are_equal_however_they_lie_in_memory() -> None:
    results = KernelResults(9)
    kernel = Counting(np.sum)
    results.of(kernel, GRID)
    results.of(kernel, np.asfortranarray(GRID))
    results.of(kernel, np.repeat(GRID, 2, axis=1)[:, ::2])
    assert kernel.calls == 1


def test_an_array_that_nobody_can_change_is_known_without_a_look_at_its_content() -> None:
    results = KernelResults(9)
    kernel = Counting(np.sum)
    source, other = read_only([1, 2]), read_only([1, 5])
    assert [results.of(kernel, array) for array in (source, other, source, other)] == [3, 6, 3, 6]
    assert kernel.calls == 2


def test_of_what_a_kernel_returns_only_what_it_was_given_is_copied() -> None:
    made, given = np.zeros(3), np.zeros(3)
    results = computed(lambda _: (made, given), given)
    assert results[0] is made
    assert not np.shares_memory(results[1], given)
    assert [result.flags.writeable for result in results] == [False, False]
    assert given.flags.writeable


def test_a_read_only_view_of_an_array_that_changes_is_computed_anew() -> None:
    results = KernelResults(9)
    kernel = Counting(np.sum)
    array = np.array([1, 2])
    view = array.view()
    view.setflags(write=False)
    assert results.of(kernel, view) == 3
    array[0] = 7
    assert results.of(kernel, view) == 9


def the_same(array: Any) -> Any:
    return array


def a_part(array: Any) -> Any:
    return array[:1]


def doubled(array: Any) -> Any:
    return 2 * array, len(array)


@WAYS
def test_a_result_stays_what_it_is_whatever_becomes_of_the_argument(way: Callable[..., Any]) -> None:
    for kernel in (the_same, a_part):
        array = np.array([1, 2])
        result = way(kernel, array)
        array[0] = 7  # which is not read-only now
        assert result[0] == 1
        assert way(kernel, np.array([1, 2]))[0] == 1


@WAYS
def test_nobody_can_change_a_result_that_others_may_get(way: Callable[..., Any]) -> None:
    result, length = way(doubled, np.array([1, 2]))
    with pytest.raises(ValueError, match="read-only"):
        result[0] = 7
    assert length == 2


def test_equal_numbers_of_different_types_are_different_arguments() -> None:
    results = KernelResults(9)
    kernel = Counting(type)
    numbers = [1, 1.0, True, np.uint8(1), np.int64(1)]
    assert [results.of(kernel, number) for number in numbers * 2] == [type(number) for number in numbers] * 2
    assert kernel.calls == 5


@pytest.mark.parametrize("number", [float, np.float32, np.float64])
def test_both_zeros_are_different_arguments(number: Callable[[float], Any]) -> None:
    results = KernelResults(9)
    kernel = Counting(np.signbit)
    assert [results.of(kernel, number(zero)) for zero in (0.0, -0.0) * 2] == [False, True] * 2
    assert kernel.calls == 2


@WAYS
def test_what_has_no_hash_is_computed_each_time(way: Callable[..., Any]) -> None:
    kernel = Counting(len)
    numbers = [1, 2]
    assert way(kernel, numbers) == 2
    numbers.append(3)
    assert way(kernel, numbers) == 3
    assert kernel.calls == 2


def test_of_an_object_that_may_change_it_is_computed_each_time() -> None:
    results = KernelResults(9)
    counting = Counting(abs)  # it has a hash, that of its identity
    calls = attrgetter("calls")
    assert results.of(calls, counting) == 0
    counting(7)
    assert results.of(calls, counting) == 1


def test_what_a_kernel_raises_has_no_context_of_ours() -> None:
    results = KernelResults(9)
    with pytest.raises(ZeroDivisionError) as raised:
        results.of(lambda numbers: numbers[0] / 0, [1])
    assert raised.value.__context__ is None


def test_two_kernels_do_not_share_results() -> None:
    results = KernelResults(9)
    assert results.of(np.max, GRID) == 5
    assert results.of(np.min, GRID) == 0


def test_only_the_results_used_last_are_kept() -> None:
    results = KernelResults(9)
    kernel = Counting(abs)
    for number in range(9):
        results.of(kernel, number)
    results.of(kernel, 0)  # used again: now 1 is the oldest
    results.of(kernel, 9)
    assert kernel.calls == 10
    results.of(kernel, 0)
    assert kernel.calls == 10
    results.of(kernel, 1)
    assert kernel.calls == 11


def test_a_kernel_that_raises_is_tried_again() -> None:
    results = KernelResults(9)
    kernel = Counting(lambda number: 1 / number)
    for _ in range(2):
        with pytest.raises(ZeroDivisionError):
            results.of(kernel, 0)
    assert kernel.calls == 2
