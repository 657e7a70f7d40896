"""Time as files write it: the same instant whatever the form, to the nanosecond."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from gritd.tools.importers.series.times import (
    DAY,
    HOUR,
    NONE,
    NS,
    TimeFormatError,
    clock,
    is_gap,
    likely_unit,
    of_numbers,
    of_texts,
    unwrapped,
)

INSTANT = datetime(2026, 11, 26, 14, 3, 5, 250_000, tzinfo=UTC)
WANTED = round(INSTANT.timestamp() * 1000) * 1_000_000


@pytest.mark.parametrize(
    "word",
    [
        "2026-11-26T14:03:05.250",
        "2026-11-26 14:03:05.25Z",
        "2026-11-26T15:03:05.25+01:00",
        "2026-11-26T15:03:05.25+0100",
        "2026-11-26 09:33:05,25-0430",
        "26.11.2026 14:03:05,250",
        "26.11.26 14:03:05.25",
        "26/11/2026 14:03:05.250000000",
        "11/26/2026 2:03:05.25 PM",
        "2026/11/26/14:03:05.25",
        "2026-11-26_14:03:05:250",
        "20261126T140305.25Z",
        "26-Nov-2026 14:03:05.25",
        "26. Nov. 2026, 14:03:05.25",
        "Nov 26, 2026 14:03:05.25",
        "Thu, 26 Nov 2026 14:03:05.25 GMT",
    ],
)
def test_the_ways_to_write_an_instant(word: str) -> None:
    assert clock([word]).read([word, f" {word} ", ""]).tolist() == [WANTED, WANTED, NONE]


@given(
    st.lists(st.integers(0, 3 * 10**18), min_size=1, max_size=20),
    st.sampled_from(["%Y-%m-%d %H:%M:%S", "%d.%m.%Y %H:%M:%S", "%Y/%m/%d/%H:%M:%S"]),
    st.integers(0, 9),
)
def test_every_digit_of_a_date_counts(instants: list[int], form: str, digits: int) -> None:
    kept = [ns - ns % 10 ** (9 - digits) for ns in instants]
    words = []
    for ns in kept:
        second = datetime(1970, 1, 1) + timedelta(seconds=ns // NS)
        words.append(second.strftime(form) + f".{ns % NS:09d}"[: digits + 1] * (digits > 0))
    assert clock(words).read(words).tolist() == kept


@given(st.lists(st.integers(-(2**62), 2**62), min_size=1, max_size=20))
def test_every_digit_of_a_number_counts(numbers: list[int]) -> None:
    """Also where a float has no room for it."""
    assert of_texts([str(n) for n in numbers], 1).tolist() == numbers
    seconds = [f"{'-' * (n < 0)}{abs(n) // NS}.{abs(n) % NS:09d}" for n in numbers]
    assert of_texts(seconds, NS).tolist() == numbers
    assert of_numbers(np.array(numbers, dtype=np.int64), 1).tolist() == numbers


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=20))
def test_numbers_of_a_program_and_of_a_text_agree(seconds: list[float]) -> None:
    found = of_numbers(np.array([*seconds, np.nan]), NS)
    assert found[-1] == NONE
    text = of_texts([repr(s) for s in seconds], NS)
    assert np.max(np.abs(found[:-1] - text)) <= 1


def test_an_epoch_with_decimals_keeps_them() -> None:
    words = ["1764166980.020000123", "1764166980,020000124", "", "1.5e3", "nan"]
    found = of_texts(words, NS).tolist()
    assert found == [1764166980020000123, 1764166980020000124, NONE, 1500 * NS, NONE]


def test_a_day_or_a_month_first_is_told_or_asked() -> None:
    assert clock(["03/04/2026 1:00", "03/14/2026 1:00"]).order == "month-day-year"
    assert clock(["03/04/2026 1:00", "14/04/2026 1:00"]).order == "day-month-year"
    with pytest.raises(TimeFormatError, match=r"expected order: day-month-year, or month-day-year"):
        clock(["03/04/2026 1:00"])
    april = clock(["03/04/2026"], "day-month-year").read(["03/04/2026"])
    assert april[0] == clock(["2026-04-03"]).read(["2026-04-03"])[0]


def test_times_of_day_go_on_past_midnight() -> None:
    words = ["23:59:59.5", "00:00:00,25", "00:00:01"]
    read = clock(words)
    found = unwrapped(read.read(words), read.period)
    assert read.period == DAY and np.diff(found).tolist() == [NS * 3 // 4, NS * 3 // 4]

    words = ["59:59.5", "00:00.25"]  # as a spreadsheet shows minutes
    read = clock(words)
    assert read.period == HOUR
    assert np.diff(unwrapped(read.read(words), read.period)).tolist() == [NS * 3 // 4]


def test_elapsed_times_go_beyond_a_day() -> None:
    words = ["23:59:59.5", "24:00:00.5", "100:00:00.5"]
    found = clock(words).read(words)
    assert np.diff(found).tolist() == [NS, 76 * HOUR]
    words = ["0 days 23:59:59.500000", "1 days 00:00:00.5", "4 days 04:00:00.5"]  # of pandas
    assert clock(words).read(words).tolist() == found.tolist()


@pytest.mark.parametrize(
    "word", ["31.02.2026 10:00", "26.11.2026 25:00", "26.13.2026", "12.5", "x"]
)
def test_what_is_no_time_is_told_with_its_place(word: str) -> None:
    with pytest.raises(TimeFormatError) as error:
        clock(["26.11.2026 10:00"]).read(["26.11.2026 10:00", word])
    assert error.value.at == 1 and word in str(error.value) and len(str(error.value)) < 200


def test_numbers_too_large_for_their_unit_are_told() -> None:
    for found in (lambda: of_texts(["1764166980000000000"], NS), lambda: of_texts(["1e400"], NS)):
        with pytest.raises(TimeFormatError, match="finer unit"):
            found()
    with pytest.raises(TimeFormatError, match="finer unit"):
        of_numbers(np.array([1.0, 1.7e18]), NS)


@given(st.text(max_size=60))
def test_any_word_is_a_time_a_gap_or_one_error(word: str) -> None:
    for read in (lambda: clock([word]).read([word]), lambda: of_texts([word], 1000)):
        try:
            assert read().size == 1
        except TimeFormatError as error:
            assert "\n" not in str(error)


def test_gaps_and_usual_units() -> None:
    gaps = "|nan|-nan|NaN|N/A|#N/A|#DIV/0!|#NV|1.#IND|-1.#IND00|1.#QNAN|-nan(ind)|null|-|inf"
    assert all(is_gap(word) for word in gaps.split("|"))
    assert not any(is_gap(word) for word in ("0", "-1", "1.5e3", "1.5", "ok"))
    assert [likely_unit(1.764166e9 * 1000.0**k + np.arange(5.0)) for k in range(4)] == [
        "s",
        "ms",
        "us",
        "ns",
    ]
    assert likely_unit(np.arange(100.0)) == ""
