"""Student's t without SciPy, against SciPy."""

import pytest
from scipy.stats import t as student

from vsnbench.statistics.student import student_quantile, student_tail

FREEDOMS = (0.7, 1, 1.5, 2, 3, 4.3, 7, 14, 14.9, 29, 74, 150, 1000)


@pytest.mark.parametrize("freedom", FREEDOMS)
def test_tail_and_quantile_are_those_of_scipy(freedom: float) -> None:
    for value in (0.0, 0.1, 1.0, 2.0, 5.0, 30.0):
        assert student_tail(freedom, value) == pytest.approx(student.sf(value, freedom), abs=1e-13, rel=1e-11)
    for chance in (0.5, 0.6, 0.75, 0.9, 0.95, 0.975, 0.995, 0.9995, 1 - 1e-9):
        assert student_quantile(freedom, chance) == pytest.approx(student.ppf(chance, freedom), abs=1e-9, rel=1e-9)


def test_many_degrees_of_freedom_are_normal_within_a_hundred_millionth() -> None:
    assert student_quantile(1e7, 0.975) == pytest.approx(student.ppf(0.975, 1e7), abs=1e-8)
