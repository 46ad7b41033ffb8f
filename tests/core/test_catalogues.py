import itertools
from dataclasses import replace

import numpy as np
import pytest

from pipecore.catalogues import match_size, sizes_of, sizes_of_all, with_sizes
from pipecore.settings import ElementSettings, SizeCatalogue
from pipecore.types import ElementKind
from tests.factories import make_result


@pytest.mark.parametrize("catalogue", list(SizeCatalogue))
def test_that_every_catalogue_that_can_be_set_is_there_and_ascends(catalogue):
    diameters = [s.outside_diameter for s in sizes_of(catalogue)]
    assert len(diameters) > 10
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
        ("ASME B36.10", 2032.0, "DN 2000 / NPS 80"),
        ("EN 10220", 26.9, "DN 20"),
        ("EN 10220", 1067.0, "DN 1050"),
        ("EN 10220 series 2", 133.0, "OD 133"),
        ("EN 10220 series 3", 108.0, "OD 108"),
        ("EN 10255", 165.1, "DN 150"),
        ("EN 1057", 54.0, "Cu 54"),
        ("EN 545 (ductile iron)", 222.0, "DN 200"),
        ("ISO 161 (plastics)", 355.0, "d 355"),
        ("JIS G3452/G3454", 216.3, "200A"),
        ("DIN 2448 (old)", 108.0, "DN 100"),
        ("GOST 8732/10704", 159.0, "DN 150"),
        ("EN 10220", 76.1, "DN 65"),
        ("EN 10220", 139.7, "DN 125"),
        ("EN 10220", 323.9, "DN 300"),
    ],
)
def test_that_outside_diameters_of_the_standards_are_found(catalogue, od_mm, name):
    size = size_of(od_mm / 1000, catalogue, 0.1)
    assert size is not None
    assert size.name == name
    assert size.outside_diameter == pytest.approx(od_mm / 1000, abs=1e-9)
    assert size.catalogue == catalogue


def size_of(outside_diameter, catalogue, tolerance_pct, sd=0.0):
    return match_size(outside_diameter, sd, [catalogue], tolerance_pct).size


def test_that_the_two_catalogues_disagree_where_the_standards_do():
    assert size_of(0.0730, "ASME B36.10", 1.0).name == "DN 65 / NPS 2 1/2"
    assert size_of(0.0730, "EN 10220", 1.0) is None
    assert size_of(0.0761, "ASME B36.10", 1.0) is None


def test_that_the_nearest_of_two_sizes_within_tolerance_is_taken_and_the_other_told():
    low = match_size(0.3190, 0.0, ["ASME B36.10"], 20.0)
    assert low.size.name == "DN 300 / NPS 12"
    assert low.other.name == "DN 350 / NPS 14"
    assert match_size(0.3450, 0.0, ["ASME B36.10"], 20.0).size.name == "DN 350 / NPS 14"


def test_that_a_size_of_another_catalogue_is_told_where_it_may_be_meant():
    # 139.7 is EN's DN 125, and 1.1 % below NPS 5.
    both = ["ASME B36.10", "EN 10220"]
    found = match_size(0.1397, 0.0001, both, 2.0)
    assert (found.size.name, found.size.catalogue) == ("DN 125", "EN 10220")
    assert found.other.name == "DN 125 / NPS 5"


def test_that_a_size_of_two_catalogues_is_that_of_the_first():
    for first, second in [("ASME B36.10", "EN 10220"), ("EN 10220", "ASME B36.10")]:
        found = match_size(0.32385, 0.0, [first, second], 1.0)
        assert found.size.catalogue == first
        assert found.other is None
    sizes = sizes_of_all(list(SizeCatalogue))
    for one, other in itertools.pairwise(sizes):
        if one.catalogue != other.catalogue:
            assert other.outside_diameter - one.outside_diameter > 0.4e-3


def test_that_the_tolerance_is_a_share_of_the_nominal_diameter():
    inside, outside = 0.1683 * 1.0199, 0.1683 * 1.0201
    assert size_of(inside, "ASME B36.10", 2.0) is not None
    assert size_of(outside, "ASME B36.10", 2.0) is None


def test_that_two_standard_deviations_have_to_lie_within_the_tolerance():
    # 1 % above DN 150: 1.7 mm of the 3.4 mm are left for 2 SD.
    assert size_of(0.1700, "ASME B36.10", 2.0, 0.0008) is not None
    assert size_of(0.1700, "ASME B36.10", 2.0, 0.0009) is None
    doubtful = match_size(0.1700, 0.0009, ["ASME B36.10"], 2.0)
    assert doubtful.other.name == "DN 150 / NPS 6"


def test_that_an_insulated_pipe_or_an_unknown_diameter_has_no_size():
    assert size_of(0.250, "ASME B36.10", 2.0) is None
    assert size_of(5.0, "ASME B36.10", 2.0) is None
    assert size_of(np.nan, "ASME B36.10", 2.0) is None


def test_that_an_unknown_catalogue_is_a_mistake_of_the_caller():
    with pytest.raises(KeyError, match="KS"):
        match_size(0.1, 0.0, ["KS"], 2.0)


PIPE = replace(make_result(1000).element(2), nominal=None, radius_sd=0.0001)


def test_that_a_reducer_has_a_size_at_each_end_and_a_sphere_none():
    settings = ElementSettings()
    cone = replace(PIPE, kind=ElementKind.CONE, radius=0.1095, radius_end=0.0842)
    sized = with_sizes(cone, settings)
    assert sized.nominal.name == "DN 200 / NPS 8"
    assert sized.nominal_end.name == "DN 150 / NPS 6"
    assert with_sizes(replace(PIPE, radius=0.0842), settings).nominal_end is None
    assert with_sizes(replace(sized, kind=ElementKind.SPHERE), settings).nominal is None


def test_that_a_size_that_a_person_chose_stays():
    chosen = replace(PIPE, radius=0.0842, is_nominal_confirmed=True)
    assert with_sizes(chosen, ElementSettings()).nominal is None
