# SPDX-License-Identifier: GPL-2.0-or-later
# Topics of ROS 2, by Cyclone DDS.
modules := outlet_ros2
pc_outlet_ros2 := CycloneDDS
