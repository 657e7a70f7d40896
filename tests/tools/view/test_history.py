"""The hour that the view keeps."""

from __future__ import annotations

import numpy as np

from gritd.tools.view.history import History


def test_the_oldest_rows_make_room_and_order_is_that_of_time() -> None:
    history = History(("a", "b"), rows=5)
    for at in range(12):
        assert history.add(float(at), {"a": at, "b": None})
    time, values = history.rows()
    assert time.tolist() == [7.0, 8.0, 9.0, 10.0, 11.0]
    assert values[:, 0].tolist() == time.tolist() and np.isnan(values[:, 1]).all()
    assert history.rows(9.5)[0].tolist() == [9.0, 10.0, 11.0]


def test_an_instant_is_kept_once_and_an_interruption_parts_the_line() -> None:
    history = History(("a",), rows=9)
    assert history.add(1.0, {"a": 1.0}) and not history.add(1.0, {"a": 2.0})
    history.interrupt()
    assert history.add(2.0, {"a": 3.0})
    assert np.isnan(history.rows()[1][:, 0]).tolist() == [False, True, False]
