# SPDX-License-Identifier: GPL-2.0-or-later
# A haptic device, or a tracker, of a VRPN server.
modules := haptic_vrpn tracker_vrpn
only_haptic_vrpn := vrpn_haptic
only_tracker_vrpn := vrpn_tracker
