// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A haptic device of VRPN's own classes: its tracker moves on a circle, its button changes each
 * 100 ms, and each force field that it gets becomes its force report and a line. See README.md.
 *
 *   server PORT HZ tracker|force
 */
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <time.h>
#include "vrpn_Button.h"
#include "vrpn_Connection.h"
#include "vrpn_ForceDevice.h"
#include "vrpn_Tracker.h"

class Force : public vrpn_ForceDevice {
      public:
	unsigned long fields = 0;

	Force(const char *name, vrpn_Connection *c) : vrpn_ForceDevice(name, c)
	{
		register_autodeleted_handler(forcefield_message_id, take, this, d_sender_id);
		register_autodeleted_handler(
			c->register_message_type(vrpn_dropped_last_connection), drop, this);
	}

	void mainloop() override
	{
		server_mainloop();
	}

	static int VRPN_CALLBACK drop(void *, vrpn_HANDLERPARAM)
	{
		printf("the last connection ended\n");
		return 0;
	}

	static int VRPN_CALLBACK take(void *data, vrpn_HANDLERPARAM p)
	{
		Force *me = static_cast<Force *>(data);
		float origin[3], force[3], jacobian[3][3], radius;
		double report[3];
		int length;

		if (decode_forcefield(p.buffer, p.payload_len, origin, force, jacobian, &radius))
			return -1;
		me->fields++;
		printf("field %a %a %a at %a %a %a radius %g\n", force[0], force[1], force[2],
		       origin[0], origin[1], origin[2], radius);
		for (int i = 0; i < 3; i++)
			report[i] = force[i];
		char *text = encode_force(length, report);
		me->d_connection->pack_message(length, p.msg_time, me->force_message_id,
					       me->d_sender_id, text,
					       vrpn_CONNECTION_LOW_LATENCY);
		delete[] text;
		return 0;
	}
};

static void wait_until(int64_t t_ns)
{
	struct timespec until = {t_ns / 1000000000, t_ns % 1000000000};

	clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr);
}

int main(int argc, char **argv)
{
	int port = atoi(argv[1]);
	double hz = atof(argv[2]), quaternion[4], position[3], velocity[3], turn[4] = {0, 0, 0, 1};
	bool forces = argc > 3 && !strcmp(argv[3], "force");
	vrpn_Connection *c = vrpn_create_server_connection(port);
	vrpn_Tracker_Server tracker("Tool", c, 2), other("Other", c);
	vrpn_Button_Server *button = forces ? new vrpn_Button_Server("Tool", c, 2) : nullptr;
	Force *force = forces ? new Force("Tool", c) : nullptr;
	struct timespec now;

	setvbuf(stdout, nullptr, _IOLBF, 0);
	clock_gettime(CLOCK_MONOTONIC, &now);
	int64_t start_ns = now.tv_sec * 1000000000LL + now.tv_nsec;
	for (long i = 0;; i++) {
		struct timeval stamp;
		double phase = (double)i / hz;

		wait_until(start_ns + (int64_t)((double)i * 1e9 / hz));
		vrpn_gettimeofday(&stamp, nullptr);
		for (int k = 0; k < 3; k++) {
			position[k] = 0.05 * sin(phase + k) + 0.001 * k;
			velocity[k] = 0.05 * cos(phase + k);
		}
		quaternion[0] = quaternion[1] = 0;
		quaternion[2] = sin(phase / 3);
		quaternion[3] = cos(phase / 3);
		other.report_pose(0, stamp, position + 0, quaternion);
		tracker.report_pose(0, stamp, position, quaternion);
		tracker.report_pose_velocity(0, stamp, velocity, turn, 1 / hz);
		position[0] += 1;
		tracker.report_pose(1, stamp, position, quaternion);
		if (button && i % (long)(hz / 10) == 0)
			button->set_button(0, i / (long)(hz / 10) & 1);
		tracker.mainloop();
		other.mainloop();
		if (button)
			button->mainloop();
		if (force)
			force->mainloop();
		c->mainloop();
	}
}
