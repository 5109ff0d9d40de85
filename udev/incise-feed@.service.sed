# SPDX-License-Identifier: GPL-2.0-or-later
# Makes incise-feed@.service, the feeder of a scene that the kernel renders, of incise-haptic@.service:
# the same limits and the same sandbox, another program. It starts first.
s/^# The haptic loop of a scene, as a service/# The feeder of a scene, as a service/
s/runs the scene neck/feeds the scene neck/
s/^Description=.*/Description=Force of scene %i in the kernel/
s/incise-haptic(1)/incise-feed(1)/
s/incise-haptic@neck/incise-feed@neck/
s/incise-haptic@%i/incise-feed@%i/
s/HAPTIC_OPTIONS/FEED_OPTIONS/
s/haptic\.env/feed.env/
s/incise haptic /incise feed /
s/^After=network\.target$/&\
# Its watcher starts behind it.\
Before=incise-haptic@%i.service/
