#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# Every picture of a camera, byte by byte and with its stamp: v4l2loopback, fed by the test.
. tests/vm/tap

[ -e "${INCISE_VM_LOOPBACK:-}" ] || skip "v4l2loopback" "tests/vm/loopback has not built it"
modprobe videodev
# eight buffers, as a camera has
check "v4l2loopback loads" insmod "$INCISE_VM_LOOPBACK" devices=2 video_nr=8,9 \
	max_buffers=8 || exit 0
"$INCISE_BUILD/tests/vm/camera_loopback" /dev/video8 /dev/video9
check "v4l2loopback goes" rmmod v4l2loopback
