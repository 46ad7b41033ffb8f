import numpy as np
import pytest

from pipecore.catalogues import nominal_size, sizes_of
from pipecore.settings import SizeCatalogue


@pytest.mark.parametrize("catalogue", list(SizeCatalogue))
def test_that_every_catalogue_that_can_be_set_is_there_and_ascends(catalogue):
    diameters = [s.outside_diameter for s in sizes_of(catalogue)]
    assert len(diameters) > 30
    assert diameters == sorted(set(diameters))


@pytest.mark.parametrize(
    ("catalogue", "od_mm", "name"),
    [
        ("ASME B36.10", 10.3, "DN 6 / NPS 1/8"),
        ("ASME B36.10", 48.3, "DN 40 / NPS 1 1/2"),
        ("ASME B36.10", 168.3, "DN 150 / NPS 6"),
        ("ASME B36.10", 273.0, "DN 250 / NPS 10"),
        ("ASME B36.10", 323.8, "DN 300 / NPS 12"),
        ("ASME B36.10", 1219.0, "DN 1200 / NPS 48"),
        ("EN 10220", 26.9, "DN 20"),
        ("EN 10220", 76.1, "DN 65"),
        ("EN 10220", 139.7, "DN 125"),
        ("EN 10220", 323.9, "DN 300"),
    ],
)
def test_that_outside_diameters_of_the_standards_are_found(catalogue, od_mm, name):
    size = nominal_size(od_mm / 1000, catalogue, 0.1)
    assert size is not None
    assert size.name == name
    assert size.outside_diameter == pytest.approx(od_mm / 1000, abs=1e-9)


def test_that_the_two_catalogues_disagree_where_the_standards_do():
    assert nominal_size(0.0730, "ASME B36.10", 1.0).name == "DN 65 / NPS 2 1/2"
    assert nominal_size(0.0730, "EN 10220", 1.0) is None
    assert nominal_size(0.0761, "ASME B36.10", 1.0) is None


def test_that_the_nearest_of_two_sizes_within_tolerance_is_taken():
    assert nominal_size(0.3190, "ASME B36.10", 20.0).name == "DN 300 / NPS 12"
    assert nominal_size(0.3450, "ASME B36.10", 20.0).name == "DN 350 / NPS 14"


def test_that_the_tolerance_is_a_share_of_the_nominal_diameter():
    inside, outside = 0.1683 * 1.0199, 0.1683 * 1.0201
    assert nominal_size(inside, "ASME B36.10", 2.0) is not None
    assert nominal_size(outside, "ASME B36.10", 2.0) is None


def test_that_an_insulated_pipe_or_an_unknown_diameter_has_no_size():
    assert nominal_size(0.250, "ASME B36.10", 2.0) is None
    assert nominal_size(5.0, "ASME B36.10", 2.0) is None
    assert nominal_size(np.nan, "ASME B36.10", 2.0) is None


def test_that_an_unknown_catalogue_is_a_mistake_of_the_caller():
    with pytest.raises(KeyError, match="JIS"):
        nominal_size(0.1, "JIS", 2.0)
