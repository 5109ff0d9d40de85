# SPDX-License-Identifier: GPL-2.0-or-later
# Frames of a camera; needs nothing but the kernel's headers.
modules := camera_v4l2
