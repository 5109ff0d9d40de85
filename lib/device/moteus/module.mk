# SPDX-License-Identifier: GPL-2.0-or-later
# Motors with torque on a CAN FD bus of the kernel.
modules := haptic_moteus
pc_haptic_moteus := libmnl
also_haptic_moteus := can/bus/socketcan
