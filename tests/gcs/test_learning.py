"""What is learnt of a pack, as a ground station saves and loads it."""

import pytest

from test_mavproxy import start_mavproxy, values_in  # noqa: F401

# One MAVProxy at a time.
pytestmark = pytest.mark.xdist_group("mavproxy")


def test_mavproxy_saves_and_loads_what_is_learnt_without_an_error(start_mavproxy, tmp_path):  # noqa: F811
    mavproxy = start_mavproxy("--streamrate=-1")
    mavproxy.ask("param save all.parm BATT_*", r"Saved \d+ parameters to all.parm")
    saved = values_in(tmp_path / "all.parm")
    assert {name: saved[name] for name in saved if "LRN" in name} == {
        "BATT_LRN_CAP": 0,
        "BATT_LRN_ERASE": 0,
        "BATT_LRN_RES": 0,
    }
    mavproxy.ask("param load all.parm", r"Loaded \d+ parameters from all.parm \(changed 0\)")
    mavproxy.type("param set BATT_LRN_ERASE 1")
    assert mavproxy.show("BATT_LRN_ERASE") == 0
    # A file of another pack's time.
    mavproxy.type("param set BATT_LRN_CAP 2950")
    mavproxy.wait_for(r"Param write denied \(BATT_LRN_CAP\)")
    assert mavproxy.show("BATT_LRN_CAP") == 0
