"""Licences as sources state them."""

import pytest

from pipeline.expert import LicenceClass, classify_licence, strictest


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("CC0-1.0", LicenceClass.PUBLIC_DOMAIN),
        ("public domain", LicenceClass.PUBLIC_DOMAIN),
        ("MIT", LicenceClass.PERMISSIVE),
        ("Apache-2.0", LicenceClass.PERMISSIVE),
        ("BSD-3-Clause", LicenceClass.PERMISSIVE),
        ("CC-BY-4.0", LicenceClass.ATTRIBUTION),
        ("CMU Graphics Lab mocap: free for research and commercial use, credit asked", LicenceClass.ATTRIBUTION),
        ("CC-BY-SA-4.0", LicenceClass.SHARE_ALIKE),
        ("CC BY-NC 4.0 (Bandai Namco Research)", LicenceClass.NON_COMMERCIAL),
        ("CC-BY-NC-SA-4.0", LicenceClass.NON_COMMERCIAL),
        ("academic and non-commercial use with citation", LicenceClass.NON_COMMERCIAL),
        ("CC BY-NC-ND 4.0 (Ubisoft LAFAN1); the carrying repo has no licence of its own", LicenceClass.NO_DERIVATIVES),
        ("CC-BY-ND-4.0", LicenceClass.NO_DERIVATIVES),
        ("MIT repo (DeepMimic); human source of each clip not stated", LicenceClass.UNKNOWN),
        ("", LicenceClass.UNKNOWN),
        (None, LicenceClass.UNKNOWN),
        ("ask Bob", LicenceClass.UNKNOWN),
    ],
)
def test_a_licence_has_its_class(text: str | None, wanted: LicenceClass):
    assert classify_licence(text) is wanted


def test_a_database_is_as_strict_as_its_strictest_clip():
    assert strictest(["CC0-1.0", "CC-BY-NC-4.0", "MIT"]) is LicenceClass.NON_COMMERCIAL
    assert strictest(["CC0-1.0", "who knows", "CC-BY-NC-ND-4.0"]) is LicenceClass.UNKNOWN
    assert strictest([]) is LicenceClass.PUBLIC_DOMAIN
