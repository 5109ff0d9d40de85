# SPDX-License-Identifier: GPL-2.0-or-later
"""The text of incise bench NAME: a report of its --json, on standard input, as tables for a terminal. A report without
tables here, as of the benchmarks for developers, is printed with all its keys, between tabs.

A column is (key, format, heading): the key of a row, "a.b" leads inwards, or a function of the row; a format of "%".
"""
import json
import re
import sys


def at(row, key):
    if callable(key):
        return key(row)
    for part in key.split("."):
        row = row.get(part) if isinstance(row, dict) else None
    return row


def width(form):
    """Characters of a column, below 0 at the left."""
    characters = int(re.search(r"\d+|$", form)[0] or 0) + len(re.sub(r"%[-+]?[\d.]*[sfg]", "", form))
    return -characters if "%-" in form else characters


def pad(value, form):
    return value.ljust(-width(form)) if width(form) < 0 else value.rjust(width(form))


def cell(row, key, form):
    value = at(row, key)
    if value is None or value == "":
        return pad("-", form)
    return form % value


def table(rows, columns, failed_after=0):
    """With failed_after the reason why a row failed takes the place of the columns behind so many."""
    lines = [" ".join(pad(heading, form) for _, form, heading in columns).rstrip()]
    for row in rows:
        failed = failed_after and row.get("failed")
        cells = [cell(row, key, form) for key, form, _ in columns[:failed_after if failed else None]]
        lines.append(" ".join(cells + [failed] if failed else cells))
    return "\n".join(lines) + "\n"


def times(key, factor):
    return lambda row: at(row, key) * factor if at(row, key) is not None else None


def machine(report, *keys):
    return "; ".join(str(report["machine"][key]) for key in keys or ("cpu", "kernel", "compiler"))


def precision(report):
    peer = report.get("fuzzylite_version")
    yield (f"model {report['model'] or ''}, {report['rules']} rules; errors at {report['points']} points, times of "
           f"{report['repeats']} runs in turn\n{machine(report, 'cpu', 'kernel')}; vectors: "
           f"{machine(report, 'vectors', 'compiler')}{f'; fuzzylite {peer}' if peer else ''}\n\n")
    yield table(report["rows"], [
        ("name", "%-18s", "evaluator"), ("ns", "%8.1f", "ns"), ("ns_p5", "%8.1f", "5 %"), ("ns_p95", "%8.1f", "95 %"),
        ("max_error_N", "%11.3g", "largest / N"), ("rms_error_N", "%11.3g", "rms / N"),
        ("bound_N", "%11.3g", "bound / N"), ("times_fuzzylite", "%11.0f", "x fuzzylite")], 1)


def training(report):
    yield (f"{machine(report, 'cpu')}\n{report['pairs']} pairs of 12 cuts, 20 unseen cuts whose force is exact; errors: "
           f"median of {report['seeds']} data sets (5 to 95 %), times: of {report['repeats']} runs in turn\n")
    yield table(report["rows"], [
        ("name", "%-16s", "method"), ("epochs", "%6.0f", "epochs"), ("ms", "%10.3g", "median ms"),
        ("ms_min", "%9.3g", "least"), ("ms_max", "%9.3g", "most"), ("rms_error_N", "%10.4f", "rmse / N"),
        ("rms_error_N_min", "  (%6.4f", ""), ("rms_error_N_max", "to %6.4f)", ""),
        ("max_error_N", "%10.4f", "largest/N"), ("mean_abs_error_N", "%10.4f", "mean |.|/N")], 1)


def realism(report):
    yield (f"{machine(report, 'cpu')}\nCuts that were held out, rendered divided by recorded: rate of events (95 % interval\n"
           "of the recorded one), rms of the texture; drops: distance of Kolmogorov and Smirnov; dB: of octaves;\n"
           "skewness of differences (recorded)\n")
    yield table(report["rows"], [
        ("set", "%-12s", "cuts of"), ("kind", "%-8s", "texture"), ("events", "%7.0f", "events"),
        ("event_rate", "%6.2f", "rate"), ("event_rate_low", "  (%4.2f", ""), ("event_rate_high", "to %4.2f)", ""),
        ("drops_ks", "%6.2f", "drops"), ("spectrum_dB", "%8.1f", "dB"), ("rms", "%6.2f", "rms"),
        ("skewness", "%9.2f", "skewness"), ("recorded_skewness", "  (%5.2f)", ""),
        (times("mean_force", 100), "%8.2f", "mean, %")])
    rows = {(row["set"], row["kind"]): row for row in report["rows"]}
    for name in dict.fromkeys(row["set"] for row in report["rows"]):
        with_it, without = rows[name, "texture"], rows[name, "none"]
        if None in (row[key] for row in (with_it, without) for key in ("event_rate", "spectrum_dB")):
            continue
        alike = (abs(with_it["event_rate"] - 1) < abs(without["event_rate"] - 1)
                 and with_it["spectrum_dB"] < without["spectrum_dB"])
        yield (f"texture of {name}: rate of events {with_it['event_rate']:.2f}, without it "
               f"{without['event_rate']:.2f}; {'more' if alike else 'not more'} alike\n")


EXPERIMENTS = {
    "exact_limit": ("largest stable stiffness of a wall alone on the device, K T^2/m: simulation compared with "
                    "eigenvalues", ""),
    "colgate": ("with the least stable passive hand of one mass and one spring: compared with Colgate and Schenkel",
                "at least: with a damper in the wall only a hand with many modes reaches the bound\n"),
    "quantisation": ("stiffness above which motion across an encoder's steps gains energy, N/mm: compared with Abbott "
                     "and Okamura", ""),
}


def verdict(row):
    return ("at least " if row["at_least"] else "") + ("ok" if row["ok"] else "MISSED")


def stability(report):
    yield f"{machine(report)}\n" + "quick: a part of each grid\n" * report["quick"] + "\n"
    for key, (title, note) in EXPERIMENTS.items():
        names = [k for k in report[key][0] if k not in ("ratio", "at_least", "ok")]
        forms = ["%14g"] + ["%13g"] * (len(names) - 3) + ["%15.6g"] * 2
        yield f"{title}\n" + table(report[key], [*zip(names, forms, names), ("ratio", "%10.6f", "ratio"),
                                                 (verdict, " %s", "")]) + f"{note}\n"
    sums, worst = report["rest_sums"], [r for r in report["rest"] if r["verdict"] == "refused" or not r["rests"] or
                                        r["rests_twice"]]
    yield ("scenes by surface and force, failures first, with the gain that a plan names when it refuses one that is "
           "far too large: accepted, and at rest under leans of a hand\n")
    yield table(sums, [
        ("surface", "%8s", "surface"), ("force", "%13s", "force"), ("cases", "%6.0f", "cases"),
        ("accepted", "%10.0f", "accepted"), ("swing", "%10.0f", "oscillate"), ("widest_mm", "%12.2g", "largest, mm"),
        ("twice", "%14.0f", "at twice it"), ("rest_twice", "%10.0f", "are stable"), ("plan_s", "%10.2f", "plan, s")])
    yield ("{cases} cases: {accepted} accepted, of which {swing} oscillate; {twice} at twice the gain, of which "
           "{rest_twice} are stable\n").format_map({k: sum(row[k] for row in sums) for k in (
               "cases", "accepted", "swing", "twice", "rest_twice")})
    yield table(worst, [
        ("surface", "%8s", "surface"), ("force", "%13s", "force"), ("mass_kg", "%5g", "kg"),
        ("damping_N_s_mm", "%6g", "N s/mm"), ("tracker_hz", "%5g", "Hz"), ("latency_ms", "%4g", "ms"),
        ("late_ticks", "%4.0f", "late"), ("verdict", "%8s", "verdict"), ("gain", "%6.3g", "gain"),
        ("swing_mm", "%9.2g", "swing, mm"), ("lean_N", "%6.3g", "N"), ("twice_mm", "%9.2g", "twice, mm")]
               ) if worst else ""
    yield "\nintegrators of a spring; errors relative to the largest displacement\n"
    yield table(report["integrators"], [
        ("integrator", "%21s", "integrator"), ("K_N_m", "%9g", "N/m"), ("step_s", "%9.3g", "step, s"),
        ("max_error", "%9.2g", "largest"), ("rms_error", "%9.2g", "rms"), ("ns_per_step", "%9.1f", "ns/step"),
        ("ns_per_ms", "%11.1f", "ns/ms")], 3)


def loop(report):
    wakeups, rows = report["wakeups"], report["wakeups"]["rows"]
    policy = (f"SCHED_FIFO {wakeups['priority']}" if wakeups["policy"] == "fifo" else
              "SCHED_OTHER, without real-time permission")
    yield f"{machine(report, 'cpu')}, {machine(report, 'kernel')}\n\n"
    yield table(report["rows"], [
        ("name", "%-16s", "ns a tick, hot"), ("tick_ns.median", "%9.0f", "median"), ("tick_ns.p99", "%9.0f", "99 %"),
        ("tick_ns.p999", "%9.0f", "99.9 %"), (times("load_s", 1e3), "%9.1f", "load/ms"),
        (times("memory_bytes", 1 / 1024), "%10.1f", "memory/KiB")])
    yield f"\nwake-up latency, us; {wakeups['seconds']:.3g} s each; {policy}, CPU {wakeups['cpu']}\n"
    yield table(rows, [
        ("rate_hz", "%6g", "Hz"), ("load", "%-6s", "load"), ("lateness_us.median", "%7.0f", "median"),
        ("lateness_us.p99", "%7.0f", "99 %"), ("lateness_us.p999", "%7.0f", "99.9 %"),
        ("lateness_us.max", "%8.0f", "max"), ("cyclictest_us.p999", "%18.0f", "cyclictest: 99.9 %"),
        ("cyclictest_us.max", "%8.0f", "max"), ("skipped", "%8.0f", "skipped"),
        ("skipped_by_machine", "%8.0f", "machine"), ("ratio_p999", "%6.2f", "ratio"),
        ("tick_cold_us", "%6.1f", "tick")], 2)
    yield ("tick: median after each sleep, with cold caches and the rig; the first table is of ticks in a row, with hot "
           "caches\n")
    yield from (f"view: {row['frames_hz']:.1f} frames per second\n" for row in rows if row["frames_hz"])
    yield from {row["no_cyclictest"] + "\n" for row in rows if row["no_cyclictest"] and not row["no_load"]}


def view(report):
    frame, shown = report["frames"][0], report["shown"]
    yield (f"{machine(report, 'cpu')}, {machine(report, 'kernel')}\n\nms per frame, {report['renderer']}, "
           f"{frame['triangles']} triangles, {frame['frames']} frames each; % within 20 ms, the 50 Hz of Song et al. "
           "(2006)\n")
    parts = {"effects": "wound, blood", "texture": "texture", "draw": "drawing", "whole": "whole"}
    yield " ".join([" " * 15] + [f" {title:<19}" for title in parts.values()] + ["% 20 ms    fps    texels\n"])
    yield table(report["frames"], [
        (lambda row: "%(texture_px)5d %(width)4dx%(height)-4d" % row, "%15s", "texture   image")] + [
            (f"{part}_ms.{key}", form, heading) for part in parts
            for key, form, heading in (("median", "%6.2f", "median"), ("p99", "%6.2f", "99 %"), ("max", "%6.1f", "max"))
        ] + [("in_20_ms_percent", "%7.1f", ""), ("frames_hz", "%6.1f", ""), ("texels", "%9.0f", "")])
    yield (f"\ndisplayed image compared with texture {shown['exact_texture_px']} at the same moment; {shown['moments']} "
           "moments\n")
    yield table(shown["rows"], [
        ("texture_px", "%7.0f", "texture"), (lambda row: row["fps"] or "exact", "%6s", "fps"),
        ("rms_error", "%8.3f", "rms"), ("rms_error_max", "%8.3f", "largest"), ("ssim", "%8.5f", "SSIM"),
        ("frame_ms", "%9.2f", "ms/frame"), ("ms_per_s", "%9.0f", "ms/s")])


def scenes(report):
    rows, spans = report["rows"], {f["name"]: f for f in report["figures"]}
    yield f"a tick of each scene, and of the full pipeline, which has all stages\n{machine(report)}\n\n"
    yield table(rows, [
        ("name", "%-18s", "scene"), ("tick_ns", "%7.1f", "ns"), ("full_ns", "%7.1f", "full ns"),
        ("times_cheaper", "%7.2f", "times"), ("plan_memory_KiB", "%9.1f", "plan KiB"),
        ("process_memory_KiB", "%9.0f", "proc. KiB"), ("libraries_mapped", "%6.0f", "libs"),
        (lambda row: {True: "same", False: "DIFFER"}.get(row["identical"]), " %s", " forces")])
    yield f"\nforces of {sum(row['ticks_compared'] for row in rows)} ticks compared bit by bit\n"
    for row in rows:
        few, full = (spans.get(f"{row['name']} {which}") for which in ("tick", "full tick"))
        if row["failed"]:
            yield f"{row['name']}: {row['failed']}\n"
        elif few and full and full["low"] <= few["high"]:  # the 95 % intervals of the medians meet
            yield f"{row['name']}: no significant difference to the full pipeline\n"
    for row in rows:
        keys = {"stages": "stages", "left out": "left_out"}
        if row["libraries"]:
            keys |= {"devices": "devices", "opened": "files_open", "libraries": "libraries",
                     "not these": "libraries_not_mapped"}
        if row["stages"] is not None:
            yield f"\n{row['name']}\n" + "".join(f"  {title:<9} {row[key] or 'none'}\n" for title, key in keys.items())


def lists(value, name=""):
    """The lists of rows within a report, by their names."""
    if isinstance(value, list) and value and isinstance(value[0], dict):
        yield name, value
    elif isinstance(value, dict):
        for key, inner in value.items():
            yield from lists(inner, f"{name}.{key}".strip("."))


def flat(row, name=""):
    if not isinstance(row, dict):
        return {name: row}
    return {k: v for key, inner in row.items() for k, v in flat(inner, f"{name}.{key}".strip(".")).items()}


def word(value):
    return "" if value is None else f"{value:.10g}" if isinstance(value, (int, float)) else str(value)


def developers(report):
    for name, rows in lists({key: value for key, value in report.items() if key != "figures"}):
        keys = list(dict.fromkeys(key for row in rows for key in flat(row)))
        lines = [keys] + [[word(flat(row).get(key)) for key in keys] for row in rows]
        yield f"\n{name}\n" + "".join("\t".join(line) + "\n" for line in lines)


def main():
    report = json.load(sys.stdin)
    name = report["schema"].split("/")[2]
    text = {f.__name__: f for f in (precision, training, realism, stability, loop, view, scenes)}.get(name, developers)
    sys.stdout.write("".join(text(report)))


if __name__ == "__main__":
    main()
