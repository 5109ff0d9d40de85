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
#include <endian.h>
#include <errno.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "../../base/vector.h"
#include "../../rig/backends.h"
#include "vrpn_device.h"

#define RADIUS_M 2
#define FIELD 64 /* bytes of its payload */
#define SILENT_NS INT64_C(1000000000)
#define CLOSE_MS 200

struct vrpn_haptic {
	struct incise_haptic haptic; /* first */
	struct vrpn_device device;
	uint64_t seq, lost;
	double origin_m[3]; /* the last position */
};

static struct vrpn_haptic *vrpn_haptic_of(const struct incise_haptic *haptic)
{
	return (struct vrpn_haptic *)haptic;
}

static bool take_pose(struct vrpn_haptic *h, const struct vrpn_pose *pose,
		      struct incise_haptic_sample *sample)
{
	uint64_t seq = h->seq++;

	if (!pose->sound) {
		h->lost++;
		return false;
	}
	*sample = (struct incise_haptic_sample){
		.t_ns = pose->t_ns,
		.seq = seq,
		.buttons = h->device.pressed,
		.flags = h->device.force_error ? INCISE_HAPTIC_PROTECTED : 0,
	};
	v3_copy(sample->position_mm, pose->position_mm);
	v3_copy(sample->velocity_mm_s, pose->velocity_mm_s);
	memcpy(sample->quaternion, pose->quaternion, sizeof(sample->quaternion));
	for (int i = 0; i < 3; i++)
		h->origin_m[i] = pose->position_mm[i] / 1000;
	return true;
}

static int haptic_read(struct incise_haptic *haptic, struct incise_haptic_sample *samples,
		       int n)
{
	struct vrpn_haptic *h = vrpn_haptic_of(haptic);
	struct vrpn_pose pose;
	int got = 0;

	vrpn_device_receive(&h->device);
	while (got < n && vrpn_device_pose(&h->device, &pose) == 1)
		got += take_pose(h, &pose, &samples[got]);
	return got ? got : h->device.gone;
}

static int haptic_wait(struct incise_haptic *haptic, int64_t most_ns)
{
	struct pollfd on = {.fd = vrpn_haptic_of(haptic)->device.link.fd,
			    .events = POLLIN};
	struct timespec most = {most_ns / 1000000000, most_ns % 1000000000};

	return ppoll(&on, 1, &most, NULL) < 0 ? -errno : 0;
}

static uint8_t *put_single(uint8_t *to, double value)
{
	float single = (float)value;
	uint32_t bits;

	memcpy(&bits, &single, sizeof(bits));
	bits = htobe32(bits);
	memcpy(to, &bits, sizeof(bits));
	return to + sizeof(bits);
}

/* Origin, force, Jacobian, radius. */
static int send_field(struct vrpn_haptic *h, const double force_N[3], double radius_m)
{
	uint8_t bytes[VRPN_HEADER + FIELD], *to = bytes + VRPN_HEADER;

	vrpn_pack(bytes, FIELD, 0, 0);
	for (int i = 0; i < 3; i++)
		to = put_single(to, h->origin_m[i]);
	for (int i = 0; i < 3; i++)
		to = put_single(to, force_N[i]);
	put_single(bytes + VRPN_HEADER + FIELD - 4, radius_m);
	return vrpn_device_send(&h->device, bytes, sizeof(bytes));
}

static int haptic_push(struct incise_haptic *haptic, const double force_N[3],
		       const double torque_N_mm[3])
{
	struct vrpn_haptic *h = vrpn_haptic_of(haptic);

	(void)torque_N_mm;
	return h->device.gone ? h->device.gone : send_field(h, force_N, RADIUS_M);
}

static void haptic_info(const struct incise_haptic *haptic,
			struct incise_haptic_info *info)
{
	const struct vrpn_haptic *h = vrpn_haptic_of(haptic);

	*info = (struct incise_haptic_info){
		.rate_hz = h->device.rate_hz,
		.latency_ns = h->device.latency_ns,
		.buttons = h->device.buttons,
		.measures_velocity = h->device.measures_velocity,
		.measures_orientation = true,
	};
	snprintf(info->name, sizeof(info->name), "%s", h->device.name);
	snprintf(
		info->note, sizeof(info->note),
		"a VRPN server keeps the last force if this machine is cut off, and some if its "
		"client ends: have a switch for its power%s",
		h->device.own_machine
			? ""
			: "; times lack the least delay of the network: set latency_ms");
}

static uint64_t haptic_lost(const struct incise_haptic *haptic)
{
	return vrpn_haptic_of(haptic)->lost;
}

/*
 * No force, after a failure, too. It waits until the server has read that: a connection that is closed
 * while poses wait on it is reset, and a reset may overtake the force.
 */
static void haptic_close(struct incise_haptic *haptic)
{
	static const double none[3];
	struct vrpn_haptic *h = vrpn_haptic_of(haptic);
	const struct server_link *link = &h->device.link;
	uint8_t bytes[4096];

	if (link->fd >= 0) {
		send_field(h, none, 0);
		shutdown(link->fd, SHUT_WR);
		for (int i = 0;
		     i < CLOSE_MS && server_link_wait(link, link->fd, POLLIN, 1) >= 0 &&
		     recv(link->fd, bytes, sizeof(bytes), 0) != 0;
		     i++)
			;
	}
	server_link_close(&h->device.link);
	free(h);
}

static int haptic_cause(struct incise_haptic *haptic, char *text, size_t size)
{
	const struct vrpn_device *device = &vrpn_haptic_of(haptic)->device;

	if (device->gone || !device->force_error)
		return vrpn_device_cause(device, text, size);
	return snprintf(
		text, size,
		"%s reports force error %d (1: its loop is late, 2: too large a force, or "
		"too warm a motor); let it cool, and start again",
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
	struct vrpn_haptic *h = calloc(1, sizeof(*h));
	int rc;

	if (!h) {
		incise_error_set(err, ENOMEM, "%s: out of memory; end other programs",
				 request->where);
		return NULL;
	}
	h->haptic.ops = &ops;
	h->device.sensors = 1;
	h->device.silent_ns = SILENT_NS;
	rc = vrpn_device_open(&h->device, request, true, err);
	if (!rc)
		return &h->haptic;
	server_link_close(&h->device.link);
	free(h);
	errno = -rc;
	return NULL;
}

const struct incise_backend incise_haptic_vrpn = {
	.abi = INCISE_BACKEND_ABI,
	.kind = "haptic",
	.name = "vrpn",
	.open = haptic_open,
};

INCISE_MODULE(incise_haptic_vrpn);
