#!/usr/bin/python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Read a file of `incise export --profile ros2` by the package rosbags and compare its values with
a resampled CSV of the same recording, which has the pose at each force sample.

    ros2.py FILE.mcap FILE.csv    one JSON object: topics, first frame of the camera
"""
import bisect
import csv
import json
import math
import sys
from pathlib import Path

from rosbags.highlevel import AnyReader

# Half of the CSV's last digit, and the rounding of a double.
TIME_S, MM, FORCE_N, Q = 0.5e-6 + 1e-9, 0.5e-4 + 1e-9, 0.5e-5 + 1e-9, 0.5e-6 + 1e-5


def ns(stamp):
    return stamp.sec * 10**9 + stamp.nanosec


def main(path, table):
    topics, forces, poses, events, frames = {}, [], [], [], []
    with AnyReader([Path(path)]) as reader:
        for connection in reader.connections:
            topics[connection.topic] = [connection.msgtype, connection.msgcount]
        for connection, log_ns, raw in reader.messages():
            m = reader.deserialize(raw, connection.msgtype)
            kind = connection.msgtype.rsplit("/")[-1]
            assert log_ns == ns(m.stamp if kind == "Log" else m.header.stamp)
            if kind == "WrenchStamped":
                assert m.header.frame_id == "scalpel" and m.wrench.force.x == 0
                forces.append((log_ns, m.wrench.force.z))
            elif kind == "PoseStamped":
                assert m.header.frame_id == "tracker"
                p, q = m.pose.position, m.pose.orientation
                poses.append((log_ns, (p.x, p.y, p.z), (q.w, q.x, q.y, q.z)))
            elif kind == "Log":
                events.append([m.name, m.msg])
            else:
                assert m.header.frame_id == "camera"
                frames.append(m)

    with open(table, encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(forces), (len(rows), len(forces))
    times, compared = [p[0] for p in poses], 0
    for row, (t_ns, force_N) in zip(rows, forces):
        assert abs((t_ns - forces[0][0]) * 1e-9 - float(row["t_s"])) <= TIME_S, row
        assert abs(force_N - float(row["force_N"])) <= FORCE_N, (row, force_N)
        i = bisect.bisect_right(times, t_ns)
        if not 0 < i < len(poses) or math.isnan(float(row["x_mm"])):
            continue
        (a_ns, a, qa), (b_ns, b, qb) = poses[i - 1], poses[i]
        if b_ns - a_ns > 12000000:
            continue  # at 120 Hz: a pose between them has no message
        share = (t_ns - a_ns) / (b_ns - a_ns)
        for name, u, v in zip("xyz", a, b):
            assert abs(1e3 * (u + share * (v - u)) - float(row[name + "_mm"])) <= MM, row
        # The CSV has the arc, this the chord: 1e-5 apart for 0.5 degrees between two poses.
        for name, u, v in zip(("qw", "qx", "qy", "qz"), qa, qb):
            assert abs(u + share * (v - u) - float(row[name])) <= Q, row
        compared += 1
    found = {"topics": topics, "compared": compared, "events": events}
    if frames:
        f = frames[0]
        found["frame"] = [f.height, f.width, f.encoding, f.step, len(f.data)]
        assert any(bytes(other.data) != bytes(f.data) for other in frames)
    print(json.dumps(found))


main(*sys.argv[1:])
