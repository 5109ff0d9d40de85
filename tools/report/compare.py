# SPDX-License-Identifier: GPL-2.0-or-later
"""Two reports of incise bench compared, metric by metric: which changed beyond noise, are gone, or new.

Standard input has {"old": …, "old_name": …, "new": …, "new_name": …}, where a report is an object with
"figures", or one whose members are such objects. Standard output gets the object of incise-bench(1) with
its "text", or "failed": why there is none. A file may have been written by anyone: each type is checked,
and names are fit for a terminal.

  time      by each reference workload, by more than these disagree, and
  measured  in its unit: the intervals are apart by more than two runs of one build are
              ├──old──┤  noise  ├──new──┤
  exact     by more than the digits of a report
"""
import json
import math
import re
import sys

# Gaps between the intervals of the same build's runs, as part of the value; measured, see
# incise-bench(1). A report's numbers have 12 digits.
NOISES = {"time": 0.05, "measured": 0.5, "exact": 1e-9}
WORKLOADS = ("yardsticks", "wide_yardsticks", "memory_yardsticks")
NAME_BYTES = 300
METRICS_MAX = 100000
MACHINE = ("version", "cpu", "compiler", "flags", "kernel", "vectors", "preempt_rt", "hypervisor", "processors",
           "governor")


class NoReport(Exception):
    """Its text says what of it is none, and why."""


# --- read ---


def require(holds, where, what):
    if not holds:
        raise NoReport(f"{where}: {what}")


def is_plain(name):
    return 0 < len(name.encode()) <= NAME_BYTES and not re.search(r"[\x00-\x1f\x7f-\x9f]", name)


def number_of(metric, key, where):
    require(key in metric, where, f"'{key}' is missing")
    value = metric[key]
    require(isinstance(value, (int, float)) and not isinstance(value, bool), where, f"'{key}' is no number")
    return float(value)


def text_of(metric, key, where):
    require(key in metric, where, f"'{key}' is missing")
    require(isinstance(metric[key], str), where, f"'{key}' is no text")
    require(is_plain(metric[key]), where, f"'{key}' is empty, too long, or holds control characters")
    return metric[key]


def interval_of(metric, key, prefix, where):
    middle, low, high = (number_of(metric, k, where) for k in (key, prefix + "low", prefix + "high"))
    require(low <= middle <= high, where, f"'{key}', {middle:g}, is not between {low:g} and {high:g}, its interval")
    return middle, low, high


def read_metric(found, benchmark, where):
    if not isinstance(found, dict):
        raise NoReport(f"{where} is no object")
    metric = {"benchmark": benchmark, "name": text_of(found, "name", where)}
    unit, kind = text_of(found, "unit", where), text_of(found, "kind", where)
    require(kind in NOISES, where, f"'{kind}' is none of time, measured and exact")
    value = number_of(found, "value", where)
    less = "better" not in found or text_of(found, "better", where) != "more"
    if kind == "time":
        by = [interval_of(found, key, key + "_", where) for key in WORKLOADS]
    else:
        by = [interval_of(found, "value", "", where) if kind == "measured" else (value, value, value)]
    return dict(metric, kind=kind, unit=unit), {"value": value, "less is better": less, "by": by}


def read_metrics(report, name):
    """By benchmark, which is None in a report of one, and name."""
    members = report if isinstance(report, dict) else {}
    lists = {b: m["figures"] for b, m in members.items() if isinstance(m, dict) and "figures" in m}
    metrics = {}
    for benchmark, found in ({None: members["figures"]} if "figures" in members else lists).items():
        require(benchmark is None or is_plain(benchmark), name,
                "a benchmark's name is empty, too long, or holds control characters")
        require(isinstance(found, list), name, f"{f'{benchmark}: ' if benchmark else ''}'figures' is no list")
        require(len(metrics) + len(found) <= METRICS_MAX, name, f"more than {METRICS_MAX} figures")
        for i, one in enumerate(found):
            where = f"{name}: {f'{benchmark}.' if benchmark else ''}figures[{i}]"
            head, values = read_metric(one, benchmark, where)
            key = (benchmark, head["name"])
            require(key not in metrics, where, f"'{head['name']}' occurs twice")
            metrics[key] = head, values
    require(metrics or "figures" in members, name,
            "no metrics; expected the output of 'incise bench NAME --json'")
    return metrics


def part_of(report, key):
    """Of a report of several benchmarks, that of the first one which has it."""
    members = [m for m in report.values() if isinstance(m, dict) and "figures" in m]
    return next((m[key] for m in [report] + members if key in m), None)


# --- compare ---


def divide(is_, was):
    return is_ / was if was else math.nan if not is_ else math.copysign(math.inf, is_)


def ratios_of(was, is_):
    """New by old; of a time by each workload."""
    return [divide(b[0], a[0]) for a, b in zip(was["by"], is_["by"])]


def disagreement(ratios):
    """By how much the workloads disagree about a time, as part of it: one of the machines, or of its
    hours, was slower at some work than at other, and at which this is, is not known."""
    sizes = [abs(r) for r in ratios if not math.isnan(r)]
    most = divide(max(sizes), min(sizes)) if len(ratios) > 1 and sizes else 1
    return most - 1 if math.isfinite(most) else 0


def nearest(ratios):
    """The one nearest to 1, by which a time is judged; None where there is none."""
    ratio = min(ratios, key=lambda r: abs(math.log(r)) if r > 0 else math.inf)
    return ratio if math.isfinite(ratio) else None


def change_of(was, is_, kind):
    """Beyond noise: 1 more, -1 less, else 0. A time changed if it did by each workload."""
    noise = NOISES[kind] + disagreement(ratios_of(was, is_))
    ways = set()
    for (a, a_low, a_high), (b, b_low, b_high) in zip(was["by"], is_["by"]):
        least = noise * max(abs(a), abs(b))
        ways.add((b_low - a_high > least) - (a_low - b_high > least))
    return ways.pop() if len(ways) == 1 else 0


def missing(here, there):
    """Metrics of one report that the other lacks. A benchmark that is not there at all is one line."""
    known = {benchmark for benchmark, _ in there} | {None}
    found = {}
    for key, (head, _) in here.items():
        if key[0] not in known:
            found[key[0]] = {"benchmark": key[0], "name": None}
        elif key not in there or there[key][0] != head:
            found[key] = head
    return list(found.values())


def compare(old, old_name, new, new_name):
    was, is_ = read_metrics(old, old_name), read_metrics(new, new_name)
    quick = part_of(old, "quick"), part_of(new, "quick")
    if set(quick) == {True, False}:
        names = (old_name, new_name) if quick[0] else (new_name, old_name)
        raise NoReport("%s was made with --quick and %s was not: compare reports of the same kind" % names)
    # In another unit it is another metric.
    common = [key for key in is_ if key in was and was[key][0] == is_[key][0]]
    if not common:
        raise NoReport(f"{old_name} and {new_name} have no metric in common: compare two reports of one benchmark, "
                       "or two of incise bench all")
    changed = []
    for key in common:
        head, b = is_[key]
        a = was[key][1]
        way = change_of(a, b, head["kind"])
        if way:
            changed.append(dict(head, old=a["value"], new=b["value"], ratio=nearest(ratios_of(a, b)),
                                worse=(way > 0) == b["less is better"]))
    worse = sum(change["worse"] for change in changed)
    machines = [part if isinstance(part, dict) else {} for part in (part_of(old, "machine"), part_of(new, "machine"))]
    return {"differs": [key for key in MACHINE if machines[0].get(key) != machines[1].get(key)], "changed": changed,
            "gone": missing(was, is_), "new": missing(is_, was), "same": len(common) - len(changed),
            "better": len(changed) - worse, "worse": worse}


# --- print ---


def name_of(metric):
    return ": ".join(name for name in (metric["benchmark"], metric["name"]) if name)


def lines_of(comparison):
    if comparison["differs"]:
        yield "machine or build differs: " + ", ".join(comparison["differs"])
    if comparison["changed"]:
        yield f"{'significant changes':52} {'old':>12} {'new':>12} {'ratio':>8}"
    for change in comparison["changed"]:
        # From 0 there is no ratio.
        ratio = "-" if change["ratio"] is None else f"{change['ratio']:.3f}"
        yield (f"{name_of(change):52} {change['old']:12.5g} {change['new']:12.5g} {ratio:>8} {change['unit']}, "
               f"{'worse' if change['worse'] else 'better'}")
    for key in ("gone", "new"):
        for metric in comparison[key]:
            yield f"{key}: {name_of(metric)}"
    yield ("{same} same, {better} better, {worse} worse, ".format(**comparison) +
           f"{len(comparison['gone'])} gone, {len(comparison['new'])} new")


def main():
    try:
        comparison = compare(**json.load(sys.stdin.buffer))
        comparison["text"] = "".join(line + "\n" for line in lines_of(comparison))
    except NoReport as why:
        comparison = {"failed": str(why)}
    json.dump(comparison, sys.stdout)


if __name__ == "__main__":
    main()
