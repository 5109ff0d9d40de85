// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Bytes of a VRPN server under libFuzzer: whatever comes, poses are sound or flagged, and in order of
 * time. Input: bytes, whose last one is the size of the parts that arrive.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "../../lib/device/vrpn/vrpn_device.h"

static void wrong(const char *what)
{
	fprintf(stderr, "vrpn_device: %s\n", what);
	abort();
}

static void check(struct vrpn_device *device, int64_t *last_ns)
{
	struct vrpn_pose pose;

	while (vrpn_device_pose(device, &pose) == 1) {
		double length = 0;

		for (int i = 0; i < 4; i++)
			length += pose.sample.quaternion[i] * pose.sample.quaternion[i];
		for (int i = 0; i < 3; i++)
			if (pose.sound && !(fabs(pose.sample.position_mm[i]) <= 1e6))
				wrong("a position that is none");
		if (pose.sound && !(fabs(length - 1) < 1e-8))
			wrong("a quaternion that is none");
		if (pose.sensor != 0 || pose.sample.t_ns <= *last_ns)
			wrong("not in order, or of another sensor");
		*last_ns = pose.sample.t_ns;
	}
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* @learnt: behind what is no VRPN a new connection begins. */
static void feed(const uint8_t *data, size_t size, bool learnt)
{
	static struct vrpn_device device;
	size_t part = size ? data[size - 1] + 1u : 1;
	int64_t last_ns = INT64_MIN;

	memset(&device, 0, offsetof(struct vrpn_device, bytes));
	memset(&device.at, 0, sizeof(device) - offsetof(struct vrpn_device, at));
	vrpn_device_init(&device, 1, INT64_MAX);
	snprintf(device.device, sizeof(device.device), "Tool");
	device.last.sample.t_ns = INT64_MIN;
	device.learnt = device.forces = learnt;
	/* As a connection gives them, without one. */
	for (size_t at = 0; at < size; at += part) {
		size_t n = part < size - at ? part : size - at;

		memmove(device.bytes, device.bytes + device.at, device.n - device.at);
		device.n -= device.at;
		device.at = 0;
		if (n > sizeof(device.bytes) - device.n)
			wrong("it waits for more than there is room for");
		memcpy(device.bytes + device.n, data + at, n);
		device.n += n;
		device.arrival_ns += 1000000;
		check(&device, &last_ns);
	}
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	feed(data, size, false);
	feed(data, size, true);
	return 0;
}
