// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A haptic device of moteus motors on a real kernel, as its owner uses it:
 *
 *   haptic_moteus INTERFACE:IDS RATE_HZ TICKS FORCE_N
 *
 * pushes a force along each line in turn, and prints one line of JSON: samples, ticks without one,
 * flags, the largest age of a sample, the error of read() or push(), the cause.
 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "../../../lib/base/monotonic.h"
#include "../../../lib/device/moteus/moteus.h"

int main(int argc, char **argv)
{
	static const double none[3];
	struct incise_haptic_setup setup = {
		.motor_direction = {1, 0, 0, 0, 1, 0, 0, 0, 1},
		.motor_mm_turn = {10, 20, 30},
		.motor_torque_N_mm = {100, 100, 100},
	};
	struct incise_backend_request request = {.where = "haptic", .haptic = &setup};
	struct incise_haptic *device;
	struct incise_error err = {0};
	struct incise_haptic_sample sample = {0};
	int ticks, samples = 0, ready = 0, rc = 0;
	int64_t period_ns, next_ns, oldest_ns = 0;
	double force_N;
	char cause[300];

	if (argc != 5)
		return 2;
	request.arguments = argv[1];
	setup.rate_hz = atof(argv[2]);
	ticks = atoi(argv[3]);
	force_N = atof(argv[4]);
	setup.n_motors = 1;
	for (const char *at = argv[1]; *at; at++)
		setup.n_motors += *at == ',';
	setup.n_motor_torques = setup.n_motors;
	setup.n_motor_directions = 3 * setup.n_motors;
	device = moteus_open_on(&can_transport_socketcan, &request, &err);
	if (!device) {
		printf("{\"open\": %d, \"text\": \"%s\"}\n", errno, err.text);
		return 1;
	}
	period_ns = (int64_t)(1e9 / setup.rate_hz);
	next_ns = incise_monotonic_ns();
	for (int i = 0; i < ticks && rc >= 0; i++) {
		double force[3] = {0};
		int64_t now_ns = incise_monotonic_ns();

		rc = incise_haptic_read(device, &sample, 1);
		if (rc == 1) {
			samples++;
			ready += !sample.flags;
			if (now_ns - sample.t_ns > oldest_ns)
				oldest_ns = now_ns - sample.t_ns;
		}
		force[i * setup.n_motors / ticks] = i & 64 ? force_N : -force_N;
		if (rc >= 0)
			rc = incise_haptic_push(device, force, none);
		next_ns += period_ns;
		incise_monotonic_sleep_until(next_ns);
	}
	incise_haptic_cause(device, cause, sizeof(cause));
	printf("{\"samples\": %d, \"ready\": %d, \"lost\": %d, \"flags\": %u, "
	       "\"age_ms\": %.3f, \"error\": %d, \"position\": %.9g, \"cause\": \"%s\"}\n",
	       samples, ready, (int)incise_haptic_lost(device), sample.flags,
	       (double)oldest_ns * 1e-6, rc, sample.position_mm[0], cause);
	device->ops->close(device);
	return rc < 0;
}
