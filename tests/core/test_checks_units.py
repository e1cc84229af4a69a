"""The border: what comes in is a clean array in a known unit, or an error that says what to do."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from o3dleaf.core.checks import attributes, coordinates, files, scalars
from o3dleaf.core.errors import InputError, O3DLeafError, UnitError
from o3dleaf.core.units import (
    METERS,
    check_unit,
    lengths_in,
    measure_in_words,
    tell_count,
    tell_length,
    tell_share,
    unit_scale,
)


@pytest.mark.parametrize(
    "points",
    [
        [[1, 2, 3], [4, 5, 6]],
        np.array([[1, 2, 3], [4, 5, 6]], dtype=np.float32),
        np.array([[1, 2, 3], [4, 5, 6]], order="F"),
        np.arange(1, 13).reshape(2, 6)[:, ::2] // 2 + [[1, 1, 1], [0, 0, 0]],
        np.matrix([[1.0, 2, 3], [4, 5, 6]]),
    ],
    ids=["list", "float32", "column-major", "strided", "matrix"],
)
def test_points_of_any_make_become_one_layout(points):
    found = coordinates.as_points(points)
    assert type(found) is np.ndarray
    assert found.dtype == np.float64
    assert found.flags.c_contiguous
    assert found.flags.aligned
    assert found.flags.writeable
    assert found.shape == (2, 3)


class Tensor:
    """As PyTorch's: numbers come only out of one without a gradient, in the memory of the machine."""

    def __init__(self, values, *, gradient=True, device="gpu"):
        self.values, self.gradient, self.device = values, gradient, device

    def detach(self):
        return Tensor(self.values, gradient=False, device=self.device)

    def cpu(self):
        return Tensor(self.values, gradient=self.gradient, device="cpu")

    def numpy(self):
        if self.gradient:
            raise RuntimeError("Can't call numpy() on Tensor that requires grad. Use tensor.detach().numpy() instead.")
        if self.device != "cpu":
            raise TypeError("can't convert to numpy. Use Tensor.cpu() to copy the tensor to host memory first.")
        return np.asarray(self.values)


def test_a_tensor_of_any_device_is_its_numbers_with_a_gradient_or_without():
    for tensor in (Tensor([[1.0, 2, 3]]), Tensor([[1.0, 2, 3]], gradient=False)):
        assert np.array_equal(coordinates.as_points(tensor), [[1.0, 2, 3]])


def test_a_clean_array_is_not_copied_and_a_read_only_one_is():
    points = np.ones((4, 3))
    assert coordinates.as_points(points) is points
    points.setflags(write=False)
    found = coordinates.as_points(points)
    assert found is not points
    assert not np.shares_memory(found, points)


def test_one_flat_point_is_taken_where_the_dimension_is_known():
    assert coordinates.as_points([1, 2, 3], dim=3).shape == (1, 3)
    with pytest.raises(InputError, match=r"shape \(3,\); give one point per row, shape \(n, d\)"):
        coordinates.as_points([1, 2, 3])


@pytest.mark.parametrize(
    ("points", "options", "message"),
    [
        (np.ones((3, 2)), {"dim": 3}, r"shape \(3, 2\); give one point per row, shape \(n, 3\)"),
        (np.ones((3, 0)), {}, r"shape \(3, 0\)"),
        (np.ones((2, 2, 2)), {}, r"shape \(2, 2, 2\)"),
        (3.0, {}, r"shape \(\)"),
        ([], {}, r"shape \(0,\)"),
        (np.empty((0, 3)), {"least": 1}, "has 0 points; at least 1"),
        ([["a", "b"]], {}, "not an array of numbers"),
        ([[1, 2], [3]], {}, "not an array of numbers"),
        ([[None, 1.0]], {}, "NaN"),
        ([[np.nan, 1], [np.inf, 2]], {}, r"2 values are NaN or infinite, the first at index \(0, 0\)"),
    ],
)
def test_what_is_no_array_of_points_is_refused_with_its_name(points, options, message):
    with pytest.raises(InputError, match=message) as caught:
        coordinates.as_points(points, "cloud", **options)
    assert str(caught.value).startswith("cloud: ")
    assert "\n" not in str(caught.value)


def test_values_are_one_a_point():
    assert attributes.as_values([1, 2], 2).dtype == np.float64
    for bad in ([1, 2, 3], [[1], [2]], 5.0):
        with pytest.raises(InputError, match=r"one value per point, shape \(2,\)"):
            attributes.as_values(bad, 2)
    with pytest.raises(InputError, match="NaN"):
        attributes.as_values([1, np.nan], 2)
    with pytest.raises(InputError, match="not an array of numbers"):
        attributes.as_values(["one", "two"], 2)


def test_weights_are_above_zero():
    np.testing.assert_array_equal(attributes.as_weights([1, 0.5], 2), [1, 0.5])
    with pytest.raises(InputError, match="1 are not above zero"):
        attributes.as_weights([1, 0], 2)


def test_bounds_are_a_lower_and_an_upper_corner():
    np.testing.assert_array_equal(coordinates.as_bounds([[0, 0], [1, 0]], 2), [[0, 0], [1, 0]])
    for bad in ([[0, 0]], [[1, 0], [0, 1]], [[0, 0], [1, 1], [2, 2]]):
        with pytest.raises(InputError, match=r"lower, then the upper one, shape \(2, 2\)"):
            coordinates.as_bounds(bad, 2)


def test_numbers_choices_and_files(tmp_path):
    assert scalars.require_positive(2, "spacing") == 2.0
    for bad in (0, -1, np.nan, np.inf, "a", None):
        with pytest.raises(InputError, match="above zero"):
            scalars.require_positive(bad, "spacing")
    assert scalars.as_number("-2", "isovalue") == -2.0
    for bad in (np.nan, -np.inf, "a", None, [1, 2]):
        with pytest.raises(InputError, match=r"isovalue: is .*; give a finite number"):
            scalars.as_number(bad, "isovalue")
    assert scalars.require_choice("b", "abc", "letter") == "b"
    with pytest.raises(InputError, match="letter: unknown 'd'; choose one of a, b, c"):
        scalars.require_choice("d", iter("abc"), "letter")
    with pytest.raises(InputError, match="no such file"):
        files.require_file(tmp_path / "missing.ply")
    with pytest.raises(InputError, match="no such file"):
        files.require_file(tmp_path)
    (tmp_path / "empty.ply").touch()
    with pytest.raises(InputError, match="the file is empty"):
        files.require_file(tmp_path / "empty.ply")
    (tmp_path / "full.ply").write_text("ply")
    assert files.require_file(str(tmp_path / "full.ply")) == tmp_path / "full.ply"


def test_every_error_of_ours_has_one_base_and_input_errors_are_value_errors():
    assert issubclass(InputError, O3DLeafError)
    assert issubclass(InputError, ValueError)
    assert issubclass(UnitError, InputError)


@given(a=st.sampled_from(list(METERS)), b=st.sampled_from(list(METERS)), c=st.sampled_from(list(METERS)))
def test_unit_scales_compose_and_invert(a, b, c):
    assert unit_scale(a, b) * unit_scale(b, c) == pytest.approx(unit_scale(a, c), rel=1e-15)
    assert unit_scale(a, b) * unit_scale(b, a) == pytest.approx(1, rel=1e-15)
    assert unit_scale(a, a) == 1.0


def test_a_millimetre_is_a_thousand_micrometres():
    assert unit_scale("mm", "um") == pytest.approx(1000)
    assert unit_scale("µm", "mm") == pytest.approx(1e-3)
    assert unit_scale("m", "cm") == pytest.approx(100)
    assert unit_scale("um", "nm") == pytest.approx(1000)


def test_both_letters_mu_are_understood():
    assert check_unit("\N{MICRO SIGN}m") == check_unit("\N{GREEK SMALL LETTER MU}m") == check_unit("um") == "um"


def test_units_never_mix_in_silence():
    assert unit_scale(None, None) == 1.0
    assert check_unit(None) is None
    for pair in (("mm", None), (None, "um")):
        with pytest.raises(UnitError, match="name the unit of both"):
            unit_scale(*pair)
    with pytest.raises(UnitError, match=r"unknown 'inch'; choose one of m, cm, mm, um, nm \(an inch is 25.4 mm"):
        check_unit("inch")


@given(st.floats(1e-9, 10))
def test_a_share_in_words_is_the_share_to_two_digits_without_an_exponent(share):
    number, sign = tell_share(share).split(" ")
    assert sign == "%"
    assert "e" not in number
    assert float(number.replace(",", "")) / 100 == pytest.approx(share, rel=0.05 + 1e-9)


def test_only_the_whole_is_a_hundred_percent():
    assert tell_share(1.0) == "100 %"
    assert tell_share(0.9996) == "99.96 %"
    assert tell_share(0.0) == "0 %"


@given(st.floats(1e-6, 1e7), st.sampled_from(sorted(METERS)), st.sampled_from([1, 2, 3]))
def test_a_measure_in_words_is_the_measure(value, unit, power):
    """Read back, it is right to half of its fourth digit; a number of a known unit has no exponent."""
    number, shown = measure_in_words(value, unit, power=power).split(" ")
    name = shown.rstrip("²³").replace("µ", "u")
    assert "e" not in number
    read = float(number.replace(",", "")) * unit_scale(name, unit) ** power
    assert read == pytest.approx(value, rel=0.5e-3 * (1 + 1e-9))


def test_a_leaf_has_an_area_in_whatever_unit():
    said = [
        measure_in_words(area, unit, power=2) for area, unit in ((3.4567e-4, "m"), (345.67, "mm"), (3.4567e8, "um"))
    ]
    assert said == ["3.457 cm²", "345.7 mm²", "3.457 cm²"]
    assert measure_in_words(0.0, "m", power=2) == "0 m²"
    assert measure_in_words((0.203, 0.011, 0.0009), "m", join=" × ") == "0.203 × 0.011 × 0.0009 m"
    assert measure_in_words((1.2e-4, -3.4e-5), "m") == "120, -34 µm"
    assert measure_in_words(1234.5678, None) == "1,235"
    assert measure_in_words(1.5e-9, None, power=3) == "1.5e-09"


def test_a_message_tells_lengths_in_the_unit_that_is_stated_around_it():
    with lengths_in("m"):
        with lengths_in("um"):
            assert tell_length(3.14159) == "3.14 µm"
        assert tell_length(0.000508) == "508 µm"
        assert tell_length(1e-6, 2) == "1 mm²"
    assert tell_length(3.14159) == "3.14"


def test_rows_of_different_lengths_and_complex_numbers_are_no_array():
    with pytest.raises(InputError, match="not an array of numbers"):
        coordinates.as_points([[1.0, 2.0], [3.0]])
    for array in ([[1j, 2.0]], np.zeros((2, 2), dtype=np.complex64)):
        with pytest.raises(InputError, match="are complex"):
            coordinates.as_points(array)


@pytest.mark.parametrize("scale", [1e-29, 1e-20, 1.0, 1e20, 1e29])
def test_points_of_any_size_whose_powers_are_numbers_are_taken(scale):
    points = scale * np.array([[0.0, 0.5, 1.0], [1.0, 0.0, 0.25]])
    assert np.array_equal(coordinates.require_size(points, "points"), points)
    assert np.array_equal(coordinates.require_size(points[:1], "points"), points[:1])


@pytest.mark.parametrize("scale", [1e51, 1e154, 1e308, 1e-51, 1e-200, 1e-308])
def test_points_whose_powers_are_no_numbers_are_refused(scale):
    with pytest.raises(InputError, match=r"1e-30 to 1e[+]30"):
        coordinates.require_size(scale * np.array([[0.0, 0.5, 1.0], [1.0, 0.0, 0.25]]), "points")


def test_a_number_of_things_has_the_noun_that_goes_with_it():
    assert [tell_count(count, "point") for count in (0, 1, 2000)] == ["0 points", "1 point", "2,000 points"]
    assert [tell_count(count, "vertex", "vertices") for count in (1, 2)] == ["1 vertex", "2 vertices"]
