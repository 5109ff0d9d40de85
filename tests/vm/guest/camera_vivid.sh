#!/bin/sh
# SPDX-License-Identifier: GPL-2.0-or-later
# Cameras of the kernel, as the library opens them, on the kernel's own virtual camera.
. tests/vm/tap

# One device, a webcam that captures and nothing else.
modprobe vivid n_devs=1 node_types=1 num_inputs=1 input_types=0 2>/dev/null ||
	skip "vivid" "this kernel has no vivid"
name=$(cd /sys/class/video4linux && grep -l '^vivid-.*-vid-cap$' video*/name | head -n 1)
name=${name%/name}
check "the virtual camera is there" [ -c "/dev/$name" ] || exit 0
# as udev does
mkdir -p /dev/v4l/by-path
ln -sf "../../$name" /dev/v4l/by-path/platform-vivid.0-video-index0
export INCISE_MODULE_PATH="$INCISE_BUILD/lib/incise"
"$INCISE_BUILD/tests/vm/camera_vivid" "/dev/$name"
rm -r /dev/v4l
check "vivid goes" modprobe -r vivid
