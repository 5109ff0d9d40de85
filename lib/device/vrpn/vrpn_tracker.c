// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A tracker of a VRPN server, "vrpn:NAME@HOST[:PORT]": sensor n - 1 is station n.
 * incise_tracker_read() receives without waiting: one or two system calls, no lock.
 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "../../base/vector.h"
#include "../../rig/backends.h"
#include "../../rig/tracker_feed.h"
#include "vrpn_device.h"

struct vrpn_tracker {
	struct incise_tracker tracker; /* first */
	struct vrpn_device device;
	struct incise_tracker_setup setup;
	struct tracker_repeat repeat[VRPN_SENSORS];
	uint64_t seq;
};

static struct vrpn_tracker *vrpn_tracker_of(const struct incise_tracker *tracker)
{
	return (struct vrpn_tracker *)tracker;
}

static void place_tool(struct vrpn_tracker *t, const struct vrpn_pose *pose,
		       struct incise_tracker_sample *sample)
{
	double whole[7], offset[3];

	v3_copy(whole, pose->position_mm);
	memcpy(whole + 3, pose->quaternion, sizeof(pose->quaternion));
	memcpy(sample->quaternion, pose->quaternion, sizeof(pose->quaternion));
	if (tracker_repeats(&t->repeat[pose->sensor], whole, 7, pose->t_ns,
			    t->setup.repeat_ms))
		sample->status = '=';
	v3_rotate(offset, pose->quaternion, t->setup.offset_mm);
	v3_add(sample->position_mm, pose->position_mm, 1, offset);
}

static void take_pose(struct vrpn_tracker *t, const struct vrpn_pose *pose,
		      struct incise_tracker_sample *sample)
{
	int64_t arrival_ns = t->device.arrival_ns;

	*sample = (struct incise_tracker_sample){.t_ns = pose->t_ns,
						 .station = (uint8_t)(pose->sensor + 1),
						 .button = t->device.pressed,
						 .status = pose->sound ? ' ' : '~',
						 .quaternion = {1}};
	if (pose->t_ns < arrival_ns)
		sample->after_ns = (uint32_t)(arrival_ns - pose->t_ns);
	if (pose->sound)
		place_tool(t, pose, sample);
	sample->seq = t->seq++;
}

static int tracker_read(struct incise_tracker *tracker,
			struct incise_tracker_sample *samples, int n)
{
	struct vrpn_tracker *t = vrpn_tracker_of(tracker);
	struct vrpn_pose pose;
	int got = 0;

	vrpn_device_receive(&t->device);
	while (got < n && vrpn_device_pose(&t->device, &pose) == 1)
		take_pose(t, &pose, &samples[got++]);
	return got ? got : t->device.gone;
}

static void tracker_info(const struct incise_tracker *tracker,
			 struct incise_tracker_info *info)
{
	const struct vrpn_tracker *t = vrpn_tracker_of(tracker);

	*info = (struct incise_tracker_info){
		.rate_hz = t->device.rate_hz,
		.stations = t->setup.n_stations,
		.scalpel_station = t->setup.stations[0],
		.tube_station = t->setup.tube_station,
		.external_sync = true, /* the sender decides when */
		.network = true,
		.lost_unsure = true,
	};
	snprintf(info->name, sizeof(info->name), "%s", t->device.name);
}

/* TCP loses nothing, and poses that a server leaves out have no numbers. */
static uint64_t tracker_lost(const struct incise_tracker *tracker)
{
	(void)tracker;
	return 0;
}

static void tracker_close(struct incise_tracker *tracker)
{
	server_link_close(&vrpn_tracker_of(tracker)->device.link);
	free(tracker);
}

static int tracker_cause(struct incise_tracker *tracker, char *text, size_t size)
{
	return vrpn_device_cause(&vrpn_tracker_of(tracker)->device, text, size);
}

static const struct incise_tracker_ops ops = {
	.read = tracker_read,
	.info = tracker_info,
	.lost = tracker_lost,
	.close = tracker_close,
	.cause = tracker_cause,
};

static void *tracker_open(const struct incise_backend_request *request,
			  struct incise_error *err)
{
	static const struct incise_tracker_setup usual = {
		.n_stations = 1, .stations = {1}, .repeat_ms = 100};
	struct vrpn_tracker *t = calloc(1, sizeof(*t));
	int rc;

	if (!t) {
		incise_error_set(err, ENOMEM, "%s: out of memory; end other programs",
				 request->where);
		return NULL;
	}
	t->tracker.ops = &ops;
	t->setup = request->tracker ? *request->tracker : usual;
	/* It sends nothing of a tool that it does not see. */
	t->device.silent_ns = INT64_MAX;
	for (int i = 0; i < t->setup.n_stations; i++)
		t->device.sensors |= UINT32_C(1) << (t->setup.stations[i] - 1);
	rc = vrpn_device_open(&t->device, request, false, err);
	if (!rc)
		return &t->tracker;
	tracker_close(&t->tracker);
	errno = -rc;
	return NULL;
}

const struct incise_backend incise_tracker_vrpn = {
	.abi = INCISE_BACKEND_ABI,
	.kind = "tracker",
	.name = "vrpn",
	.open = tracker_open,
};

INCISE_MODULE(incise_tracker_vrpn);
