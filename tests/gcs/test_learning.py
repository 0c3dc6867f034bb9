"""What the simulated rover learns of its pack, in ground stations."""

import time

import pytest

from station import connect, read, receive, restarted, set_to
from test_mavproxy import start_mavproxy, values_in  # noqa: F401

# One MAVProxy at a time.
pytestmark = pytest.mark.xdist_group("mavproxy")

SPEEDUP = 100
LABEL_MAH = 2750
PACK_MAH = 2200


def draw(connection, amperes, seconds):
    """Draws from the pack for some simulated seconds; returns the texts of that time."""
    connection.mav.param_set_send(1, 1, b"SIM_BATT_CURRENT", amperes, 9)
    texts = []
    end = time.monotonic() + seconds / SPEEDUP
    while (left := end - time.monotonic()) > 0:
        message = connection.recv_match(type="STATUSTEXT", blocking=True, timeout=left)
        if message is not None:
            texts.append(message.text)
    return texts


def value(connection, name):
    return read(connection, name).param_value


def test_a_drive_teaches_the_pack_until_it_is_erased(start_simulator):
    url = start_simulator("--speedup", str(SPEEDUP)).url
    connection = connect(url)
    settings = {"BATT_MONITOR": 4, "BATT_CURR_PIN": 27, "BATT_CAPACITY": LABEL_MAH, "BATT_CELLS": 3}
    for name, setting in settings.items():
        set_to(connection, name, setting)
    connection = restarted(connection, url)
    texts = draw(connection, 0, 30)
    for _ in range(25):
        texts += draw(connection, 12, 20) + draw(connection, 3, 20)
    texts += draw(connection, 0, 120)
    learnt = [text for text in texts if "learnt" in text]
    assert len(learnt) == 1 and learnt[0].startswith("Battery 1 learnt: 2"), texts
    assert value(connection, "BATT_LRN_CAP") == pytest.approx(PACK_MAH, rel=0.1)
    # 36 mOhm and a part of what follows slowly.
    assert value(connection, "BATT_LRN_RES") == pytest.approx(38, abs=4)

    assert set_to(connection, "BATT_LRN_ERASE", 1).get_type() == "PARAM_VALUE"
    while receive(connection, "PARAM_VALUE").param_id != "BATT_LRN_ERASE":
        pass
    draw(connection, 0, 300)
    for name in ("BATT_LRN_CAP", "BATT_LRN_RES", "BATT_LRN_ERASE"):
        assert value(connection, name) == 0, name


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
