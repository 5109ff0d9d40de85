# SPDX-License-Identifier: GPL-2.0-or-later
"""An outlet of the Lab Streaming Layer, by pylsl: a force whose value is its own sample's number.

    lsl_send.py NAME [--rate HZ] [--seconds S] [--unit UNIT] [--hole I:N] [--nan I] [--ahead I]
                     [--irregular] [--recover] [--wait] [--offset S] [--back N] [--times N] [--pause I]

Sample i has the timestamp T0 + i/rate and the force (i % 1000) / 32768 N; it prints T0 in ns, and
ends after S seconds. With --wait it prints 0 first, and T0 is when the first inlet is there. The samples I … I + N - 1 are not sent; one is stamped 60 s later.
Of every N-th the stamp is 5 s early; all stamps are S later; each sample is sent N times;
before sample I it waits for an hour.
"""
import argparse
import time

import pylsl


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("name")
    parser.add_argument("--rate", type=float, default=1000)
    parser.add_argument("--seconds", type=float, default=3600)
    parser.add_argument("--unit", default="N")
    parser.add_argument("--hole", default="0:0")
    parser.add_argument("--nan", type=int, default=-1)
    parser.add_argument("--ahead", type=int, default=-1)
    parser.add_argument("--offset", type=float, default=0)
    parser.add_argument("--back", type=int, default=0)
    parser.add_argument("--pause", type=int, default=-1)
    parser.add_argument("--times", type=int, default=1)
    parser.add_argument("--irregular", action="store_true")
    parser.add_argument("--recover", action="store_true")
    parser.add_argument("--wait", action="store_true")
    options = parser.parse_args()
    first, missing = map(int, options.hole.split(":"))
    info = pylsl.StreamInfo(
        options.name,
        "Force",
        3,
        pylsl.IRREGULAR_RATE if options.irregular else options.rate,
        pylsl.cf_float32,
        options.name if options.recover else "",
    )
    channels = info.desc().append_child("channels")
    for label, unit in (("Mx", "Nm"), ("Fz", options.unit), ("t", "")):
        channel = channels.append_child("channel")
        channel.append_child_value("label", label)
        channel.append_child_value("type", "Force")
        if unit:
            channel.append_child_value("unit", unit)
    outlet = pylsl.StreamOutlet(info)
    if options.wait:
        print(0, flush=True)
        while not outlet.wait_for_consumers(60):
            pass
    start = pylsl.local_clock()
    print(round(start * 1e9), flush=True)
    sent = 0
    while sent < options.seconds * options.rate:
        due = (pylsl.local_clock() - start) * options.rate
        while sent < min(due, options.seconds * options.rate):
            if sent == options.pause:
                time.sleep(3600)
            if not first <= sent < first + missing:
                value = float("nan") if sent == options.nan else sent % 1000 / 32768
                late = 60 * (sent == options.ahead) + options.offset
                if options.back and sent % options.back == options.back - 1:
                    late -= 5
                for _ in range(options.times):
                    outlet.push_sample([-1.0, value, 0.0], start + sent / options.rate + late)
            sent += 1
        time.sleep(0.002)


main()
