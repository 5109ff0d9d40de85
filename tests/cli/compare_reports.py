# SPDX-License-Identifier: GPL-2.0-or-later
"""tools/report/compare.py, on reports that are made: how often it calls two runs of one distribution
different, and what it finds."""
import os
import random
import statistics
import sys
import unittest

sys.path.insert(0, os.path.join(os.path.dirname(__file__), "../../tools/report"))
from compare import WORKLOADS, compare  # noqa: E402

TURNS = 101
PAIRS = 500
BENCH_NS = 100
EVEN = (1, 1, 1)  # how slow the machine is at each kind of work


def spread(prefix, values):
    """The interval as tools/bench/harness.h has it: from the 3rd to the 10th of 12 medians."""
    ends = [TURNS * i // 12 for i in range(13)]
    medians = sorted(statistics.median(values[a:b]) for a, b in zip(ends, ends[1:]))
    middle = statistics.median(values)
    return middle, {prefix + "low": min(medians[2], middle), prefix + "high": max(medians[9], middle)}


def made(slower, numbers):
    """A report with values that are off by a tenth."""
    ns = [BENCH_NS * slower * numbers.lognormvariate(0, 0.1) for _ in range(TURNS)]
    middle, interval = spread("", ns)
    time = dict(interval, name="time", kind="time", unit="ns", value=middle)
    for key in WORKLOADS:
        time[key], interval = spread(key + "_", [x / 1e4 for x in ns])
        time.update(interval)
    return {"figures": [time, dict(time, name="measured", kind="measured"),
                        {"name": "exact", "kind": "exact", "unit": "N", "value": 1 / 3}]}


def sharp(value, machine):
    """One time, by each reference workload, all off by 1 %: as a quiet machine gives it."""
    time = {"name": "time", "kind": "time", "unit": "us", "value": value / 1e3}
    for key, unit in zip(WORKLOADS, machine):
        time.update({key: value / unit, key + "_low": 0.99 * value / unit, key + "_high": 1.01 * value / unit})
    return {"figures": [time]}


def exact(unit="N", more=False, **values):
    """One without a value failed, and is not there."""
    better = {"better": "more"} if more else {}
    return {"figures": [dict(better, name=name, kind="exact", unit=unit, value=value)
                        for name, value in values.items() if value is not None]}


def counts(old, new):
    found = compare(old, "OLD", new, "NEW")
    return [found["same"], found["better"], found["worse"], len(found["gone"]), len(found["new"])]


class Comparison(unittest.TestCase):
    def tally(self, was, is_):
        numbers = random.Random(1)
        all_ = [counts(made(was, numbers), made(is_, numbers)) for _ in range(PAIRS)]
        self.assertEqual({sum(n) for n in all_}, {3})
        return sum(n[1] for n in all_), sum(n[2] for n in all_)

    def test_the_same_is_the_same(self):
        # At most 5 % of the pairs: intervals of 95 % that are apart are rare even without a floor
        # below which nothing is called.
        self.assertLessEqual(sum(self.tally(1, 1)), PAIRS / 20)

    def test_slower_is_found(self):
        # Of a median of 101 values that are off by a tenth half an interval is 3 %: twice that and
        # the 5 % that are called nothing are all but always below 15 %.
        better, worse = self.tally(1, 1.15)
        self.assertTrue(worse > PAIRS * 0.6 and not better)
        better, worse = self.tally(1.15, 1)
        self.assertTrue(better > PAIRS * 0.6 and not worse)

    def test_sharp_times(self):
        for slower, machine, better, worse in (
                (1, EVEN, 0, 0), (1.03, EVEN, 0, 0),
                (1.1, EVEN, 0, 1),  # ten percent are found
                (0.9, EVEN, 1, 0),
                (2, (2, 2, 2), 0, 0),  # it is the machine
                (2.2, (2, 2, 2), 0, 1),  # and the program
                (1.5, (1.05, 1.5, 1.3), 0, 0),  # of a core that is shared
                (1.8, (1.05, 1.5, 1.3), 0, 0),  # it cannot be determined
                (3, (1.05, 1.5, 1.3), 0, 1)):
            with self.subTest(slower=slower, machine=machine):
                found = counts(sharp(7, EVEN), sharp(7 * slower, machine))
                self.assertEqual(found, [1 - better - worse, better, worse, 0, 0])

    def test_exact_ones(self):
        for was, is_, more, same, better, worse, gone, new in (
                (1, 1, False, 2, 0, 0, 0, 0),
                (1, 1 + 1e-11, False, 2, 0, 0, 0, 0),  # a digit that is not printed
                (1, 1.0001, False, 1, 0, 1, 0, 0),
                (1, 1.0001, True, 1, 1, 0, 0, 0),
                (1, 0.5, False, 1, 1, 0, 0, 0),
                (1, 0.5, True, 1, 0, 1, 0, 0),
                (0, 0, False, 2, 0, 0, 0, 0),
                (0, 1e-30, False, 1, 0, 1, 0, 0),  # no longer nothing
                (-1, 1, False, 1, 0, 1, 0, 0),
                (1, None, False, 1, 0, 0, 1, 0),
                (None, 1, False, 1, 0, 0, 0, 1),
                (1e308, -1e308, False, 1, 1, 0, 0, 0)):
            with self.subTest(was=was, is_=is_, more=more):
                found = counts(exact(a=5, b=was, more=more), exact(a=5, b=is_, more=more))
                self.assertEqual(found, [same, better, worse, gone, new])

    def test_another_unit_is_another_metric(self):
        was, is_ = (exact(unit, a=1)["figures"] + exact(b=1)["figures"] for unit in ("N", "mN"))
        self.assertEqual(counts({"figures": was}, {"figures": is_}), [1, 0, 0, 1, 1])

    def test_many_benchmarks(self):
        # One that is not there is one line; of many that takes no more than one look each.
        n = 20000
        was, is_ = ({f"{side}{i}": exact(a=1, b=2) for i in range(n)} for side in ("old", "new"))
        was["both"] = is_["both"] = exact(a=1, b=2)
        is_["empty"] = exact()
        self.assertEqual(counts(was, is_), [2, 0, 0, n, n])


if __name__ == "__main__":
    unittest.main()
