"""The picture of a session with MAVProxy can be drawn again."""

import re
from xml.etree import ElementTree

import pytest

import draw_mavproxy
from draw_mavproxy import SESSION, draw, record

# One MAVProxy at a time: what it repeats in time, it repeats late on a machine that starts others.
pytestmark = pytest.mark.xdist_group("mavproxy")


def test_the_session_ends_with_the_failsafe_and_is_drawn_whole(monkeypatch):
    # Lines may come in another order than they are drawn.
    monkeypatch.setattr(draw_mavproxy, "QUIET_S", 0.8)
    lines = record()
    assert re.search(r"^AP: Battery 1 is low 6\.\d+V", "\n".join(lines), re.MULTILINE), lines
    assert lines[-1].endswith("Mode HOLD")
    picture = ElementTree.fromstring(draw(lines, "A session"))
    drawn = [element.text for element in picture.iter() if element.text]
    for typed, _ in SESSION:
        assert typed in drawn, typed
    assert any(text.startswith("AP: Battery 1 is low") for text in drawn)
