#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# A recording of an hour in simulated time, with force at 10 kHz and a tracker at 240 Hz (twice the rig's).
# For measuring the export, by hand; with depths of frames at 60 Hz where "camera" is said, which takes a
# quarter of an hour:
#
#     tests/bench/hour.sh BUILD hour.rec [camera]
#     /usr/bin/time -v BUILD/bin/incise export hour.rec -o hour.h5
set -eu
build=$1 rec=$2
rig=sim:clock=simulated,cut_s=250,tracker_hz=240,camera_hz=60
"$build/bin/incise" capture -o "$rec" --rig $rig --duration 1h ${3:+--camera depth} >/dev/null
du -sh "$rec"
