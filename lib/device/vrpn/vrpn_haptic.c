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
#include <math.h>
#include <poll.h>
#include <stdio.h>
#include "../../base/vector.h"
#include "../../rig/backends.h"
#include "vrpn_device.h"

#define RADIUS_M 2
#define SILENT_NS INT64_C(1000000000)
#define CLOSE_MS 200

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
	return got ? got : device->gone;
}

/* Without a known largest force there is none. On the wire it is of single precision. */
static int haptic_push(struct incise_haptic *haptic, const double force_N[3],
		       const double torque_N_mm[3])
{
	struct vrpn_device *device = device_of(haptic);
	double size_N = v3_length(force_N), limited_N[3];
	double peak_N = fmin(haptic->info.peak_N, FLT_MAX) * (1 - FLT_EPSILON);
	double share = !(haptic->info.peak_N > 0) ? 0
		       : size_N > peak_N	  ? peak_N / size_N
						  : 1;

	(void)torque_N_mm;
	for (int i = 0; i < 3; i++)
		limited_N[i] = force_N[i] * share;
	return device->gone ? device->gone
			    : vrpn_device_force(device, limited_N, RADIUS_M);
}

static int haptic_wait(struct incise_haptic *haptic, int64_t most_ns)
{
	struct pollfd on = {.fd = device_of(haptic)->link.fd, .events = POLLIN};
	struct timespec most = {most_ns / 1000000000, most_ns % 1000000000};

	return ppoll(&on, 1, &most, NULL) < 0 ? -errno : 0;
}

static void haptic_info(const struct incise_haptic *haptic,
			struct incise_haptic_info *info)
{
	const struct vrpn_device *device = device_of(haptic);

	*info = (struct incise_haptic_info){
		.rate_hz = device->rate_hz,
		.latency_ns = device->latency_ns,
		.buttons = (uint32_t)device->buttons,
		.features = INCISE_HAPTIC_PAGE_ORIENTATION |
			    (device->measures_velocity ? INCISE_HAPTIC_PAGE_VELOCITY : 0),
	};
	snprintf(info->name, sizeof(info->name), "%s", device->name);
	snprintf(
		info->note, sizeof(info->note),
		"a VRPN server keeps the last force if this machine is cut off, and some if "
		"its client ends: have a switch for its power%s",
		device->own_machine
			? ""
			: "; times lack the least delay of the network: set latency_ms");
}

static uint64_t haptic_lost(const struct incise_haptic *haptic)
{
	return device_of(haptic)->lost;
}

/*
 * No force, after a failure, too. It waits until the server has read that: a connection that is closed
 * while poses wait on it is reset, and a reset may overtake the force.
 */
static void haptic_close(struct incise_haptic *haptic)
{
	static const double none[3];
	struct vrpn_device *device = device_of(haptic);
	const struct server_link *link = &device->link;
	uint8_t bytes[4096];

	vrpn_device_force(device, none, 0);
	shutdown(link->fd, SHUT_WR);
	for (int i = 0; i < CLOSE_MS && recv(link->fd, bytes, sizeof(bytes), 0); i++)
		server_link_wait(link, link->fd, POLLIN, 1);
	vrpn_device_free(device);
}

static int haptic_cause(struct incise_haptic *haptic, char *text, size_t size)
{
	const struct vrpn_device *device = device_of(haptic);

	if (device->gone || !device->force_error)
		return vrpn_device_cause(device, text, size);
	return snprintf(
		text, size,
		"%s reports force error %d (1: its loop is late, 2: too large a force, "
		"or too warm a motor); let it cool, and start again",
		device->name, device->force_error);
}

static const struct incise_haptic_ops ops = {
	.read = haptic_read,
	.push = haptic_push,
	.wait = haptic_wait,
	.info = haptic_info,
	.lost = haptic_lost,
	.close = haptic_close,
	.cause = haptic_cause,
};

static void *haptic_open(const struct incise_backend_request *request,
			 struct incise_error *err)
{
	struct vrpn_device *device = vrpn_device_new(request, 1, SILENT_NS, true, err);

	if (device)
		device->face.haptic.ops = &ops;
	return device;
}

const struct incise_backend incise_haptic_vrpn = {
	.abi = INCISE_BACKEND_ABI,
	.kind = "haptic",
	.name = "vrpn",
	.open = haptic_open,
};

INCISE_MODULE(incise_haptic_vrpn);
