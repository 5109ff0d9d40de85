// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A force device of a VRPN server, "vrpn:NAME@HOST[:PORT]": poses of sensor 0, velocities and buttons
 * come from it, forces go there as force fields:
 *
 *     force = F + J (x - x0) where |x - x0| <= radius; else none.  Here J = 0, x0 is the last position.
 *
 * VRPN has no command for a force alone, and no deadman: a server keeps the last field. By the source
 * of 07.38 those of Phantoms and of DirectX joysticks end it when the last of all their clients has
 * disconnected, that of the Falcon never. A process that dies disconnects; a cable that is pulled
 * does not. The Falcon's server also takes 0.1 of the radius while fields come, and 10 ms for two
 * thirds of a new force; so the radius is ten times that of a workspace.
 */
#include <errno.h>
#include <float.h>
#include <poll.h>
#include <stdio.h>
#include "vrpn_device.h"

#define SILENT_NS INT64_C(1000000000)

static struct vrpn_device *device_of(const struct incise_haptic *haptic)
{
	return (struct vrpn_device *)haptic;
}

static int haptic_read(struct incise_haptic *haptic, struct incise_haptic_sample *samples,
		       int n)
{
	struct vrpn_device *device = device_of(haptic);
	struct vrpn_pose pose;
	int got = 0;

	vrpn_device_receive(device);
	while (got < n && vrpn_device_pose(device, &pose) == 1)
		if (pose.sound)
			samples[got++] = pose.sample;
	if (device->force_error && !haptic->error)
		snprintf(
			haptic->cause, sizeof(haptic->cause),
			"%s reports force error %d (1: its loop is late, 2: too large a force, "
			"or too warm a motor); let it cool, and start again",
			haptic->info.name, device->force_error);
	return got ? got : haptic->error;
}

/* On the wire a force is of single precision. */
static int haptic_push(struct incise_haptic *haptic, const double force_N[3],
		       const double torque_N_mm[3])
{
	double peak_N = haptic->info.peak_N, limited_N[3];

	(void)torque_N_mm;
	incise_haptic_limit(limited_N, force_N, 1,
			    (peak_N > FLT_MAX ? FLT_MAX : peak_N) * (1 - FLT_EPSILON));
	return vrpn_device_force(device_of(haptic), limited_N);
}

static int haptic_wait(struct incise_haptic *haptic, int64_t most_ns)
{
	const struct vrpn_device *device = device_of(haptic);
	struct pollfd on = {.fd = device->leaving ? -1 : device->link.fd,
			    .events = POLLIN};
	struct timespec most = {most_ns / 1000000000, most_ns % 1000000000};

	return ppoll(&on, 1, &most, NULL) < 0 ? -errno : 0;
}

static void haptic_close(struct incise_haptic *haptic)
{
	vrpn_device_free(device_of(haptic));
}

static const struct incise_haptic_ops ops = {
	.read = haptic_read,
	.push = haptic_push,
	.wait = haptic_wait,
	.close = haptic_close,
};

static void *haptic_open(const struct incise_backend_request *request,
			 struct incise_error *err)
{
	struct vrpn_device *device = vrpn_device_new(request, 1, SILENT_NS, true, err);

	if (!device)
		return NULL;
	device->haptic.ops = &ops;
	device->haptic.info.features |= INCISE_HAPTIC_PAGE_ORIENTATION;
	snprintf(
		device->haptic.info.note, sizeof(device->haptic.info.note),
		"a VRPN server keeps the last force if this machine is cut off, and some if "
		"its client ends: have a switch for its power%s",
		device->own_machine
			? ""
			: "; times lack the least delay of the network: set latency_ms");
	return device;
}

INCISE_BACKEND(incise_haptic_vrpn, "haptic", "vrpn", .open = haptic_open);
