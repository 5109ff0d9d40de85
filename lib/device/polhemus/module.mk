# SPDX-License-Identifier: GPL-2.0-or-later
# One tracker on two kinds of line.
modules := tracker_usb tracker_tty
pc_tracker_usb := libusb-1.0
only_tracker_usb := polhemus_usb
only_tracker_tty := polhemus_tty
