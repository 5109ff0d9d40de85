/* SPDX-License-Identifier: LGPL-2.1-or-later */
/*
 * Messages of ROS 2 as incise writes them, to files and to the network: their types, their frames, and
 * the order and units of their numbers. A stamp is UTC.
 */
#ifndef INCISE_ROS2_H
#define INCISE_ROS2_H

#include <stdint.h>

#define ROS2_POSE "geometry_msgs/msg/PoseStamped"
#define ROS2_WRENCH "geometry_msgs/msg/WrenchStamped"
#define ROS2_LOG "rcl_interfaces/msg/Log"
#define ROS2_LOG_INFO 20

#define ROS2_FRAME_TRACKER "tracker" /* of poses, and of the forces of a loop */
#define ROS2_FRAME_SCALPEL "scalpel" /* of measured forces: the scalpel lies along z */

/* builtin_interfaces/Time. */
struct ros2_time {
	int32_t sec;
	uint32_t nanosec;
};

static inline struct ros2_time ros2_time(uint64_t utc_ns)
{
	uint64_t s = utc_ns / 1000000000;

	return (struct ros2_time){s > INT32_MAX ? INT32_MAX : (int32_t)s,
				  (uint32_t)(utc_ns % 1000000000)};
}

/* A pose in metres, then its quaternion x, y, z, w; @quaternion is w first. */
static inline void ros2_pose(double values[7], const double position_mm[3],
			     const double quaternion[4])
{
	for (int i = 0; i < 3; i++)
		values[i] = position_mm[i] * 1e-3;
	for (int i = 0; i < 4; i++)
		values[3 + i] = quaternion[(i + 1) % 4];
}

#endif
