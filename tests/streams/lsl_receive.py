# SPDX-License-Identifier: GPL-2.0-or-later
"""Inlets of the Lab Streaming Layer, by pylsl.

    lsl_receive.py COUNT NAME…

Prints JSON: for each NAME its type, rate, labels, types and units by its description, and the
samples and times that came until each stream of numbers had COUNT, with the correction of the clock
applied.
"""
import json
import sys
import time

import pylsl


def described(info):
    channels = []
    channel = info.desc().child("channels").child("channel")
    while not channel.empty():
        channels.append([channel.child_value(key) for key in ("label", "type", "unit")])
        channel = channel.next_sibling("channel")
    return {
        "type": info.type(),
        "rate": info.nominal_srate(),
        "channels": channels,
        "source": info.source_id(),
        "samples": [],
        "times": [],
    }


def main():
    inlets = {}
    for name in sys.argv[2:]:
        found = pylsl.resolve_byprop("name", name, 1, 60)
        if not found:
            sys.exit(f"no stream {name}")
        inlet = pylsl.StreamInlet(found[0])
        inlet.open_stream(60)
        inlets[name] = (inlet, described(inlet.info(60)), inlet.time_correction(60))
    numbers = [
        report["samples"]
        for inlet, report, _ in inlets.values()
        if inlet.channel_format != pylsl.cf_string
    ]
    print("ready", file=sys.stderr, flush=True)
    end = time.monotonic() + 300
    while min(map(len, numbers)) < int(sys.argv[1]):
        if time.monotonic() > end:
            sys.exit(f"only {[len(samples) for samples in numbers]} in 300 s")
        for inlet, report, correction in inlets.values():
            samples, times = inlet.pull_chunk(0.0)
            report["samples"] += samples
            report["times"] += [t + correction for t in times]
        time.sleep(0.005)
    json.dump({name: report for name, (_, report, _) in inlets.items()}, sys.stdout)


main()
