// SPDX-License-Identifier: LGPL-2.1-or-later
/*
 * A tracker of a VRPN server, "vrpn:NAME@HOST[:PORT]": sensor n - 1 is station n.
 * incise_tracker_read() receives without waiting: one or two system calls, no lock; while it is connected
 * again, some more each 250 ms.
 */
#include <stdio.h>
#include <string.h>
#include "../../base/vector.h"
#include "vrpn_device.h"

#define SLIP 2 /* periods */

static struct vrpn_device *device_of(const struct incise_tracker *tracker)
{
	return (struct vrpn_device *)tracker;
}

static void place_tool(struct vrpn_device *device, const struct vrpn_pose *pose,
		       struct incise_tracker_sample *sample)
{
	const struct incise_haptic_sample *from = &pose->sample;
	double whole[7], offset[3];

	v3_copy(whole, from->position_mm);
	memcpy(whole + 3, from->quaternion, sizeof(from->quaternion));
	memcpy(sample->quaternion, from->quaternion, sizeof(from->quaternion));
	if (tracker_repeats(&device->repeat[pose->sensor], whole, 7, from->t_ns,
			    device->setup.repeat_ms))
		sample->status = '=';
	v3_rotate(offset, from->quaternion, device->setup.offset_mm);
	v3_add(sample->position_mm, from->position_mm, 1, offset);
}

static void take_pose(struct vrpn_device *device, const struct vrpn_pose *pose,
		      struct incise_tracker_sample *sample)
{
	int64_t after_ns = device->arrival_ns - pose->sample.t_ns;
	uint64_t missing;

	*sample = (struct incise_tracker_sample){
		.t_ns = pose->sample.t_ns,
		.seq = pose->sample.seq,
		.station = (uint8_t)(pose->sensor + 1),
		.button = pose->sample.buttons,
		.status = pose->sound ? ' ' : '~',
		.quaternion = {1},
		.after_ns = after_ns > 0 ? (uint32_t)after_ns : 0};
	if (pose->sound)
		place_tool(device, pose, sample);
	missing = incise_pace_add(&device->pace, sample->t_ns, device->arrival_ns);
	/* Poses that a server leaves out have no numbers; one that sends by sleeping slips. */
	device->missing += missing > SLIP ? missing : 0;
	sample->seq += device->missing;
}

static int tracker_read(struct incise_tracker *tracker,
			struct incise_tracker_sample *samples, int n)
{
	struct vrpn_device *device = device_of(tracker);
	struct vrpn_pose pose;
	int got = 0;

	vrpn_device_receive(device);
	while (got < n && vrpn_device_pose(device, &pose) == 1)
		take_pose(device, &pose, &samples[got++]);
	return got ? got : device->haptic.error;
}

static void tracker_info(const struct incise_tracker *tracker,
			 struct incise_tracker_info *info)
{
	const struct vrpn_device *device = device_of(tracker);

	*info = (struct incise_tracker_info){
		.rate_hz = device->haptic.info.rate_hz,
		.stations = device->setup.n_stations,
		.scalpel_station = device->setup.stations[0],
		.tube_station = device->setup.tube_station,
		.external_sync = true, /* the sender decides when */
		.network = true,
		.lost_unsure = device->pace.unsure,
	};
	snprintf(info->name, sizeof(info->name), "%s", device->haptic.info.name);
}

static uint64_t tracker_lost(const struct incise_tracker *tracker)
{
	return device_of(tracker)->missing;
}

static void tracker_close(struct incise_tracker *tracker)
{
	vrpn_device_free(device_of(tracker));
}

static int tracker_cause(struct incise_tracker *tracker, char *text, size_t size)
{
	return snprintf(text, size, "%s", device_of(tracker)->haptic.cause);
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
	const struct incise_tracker_setup *setup =
		request->tracker ? request->tracker : &usual;
	struct vrpn_device *device;
	uint32_t sensors = 0;

	for (int i = 0; i < setup->n_stations; i++)
		sensors |= UINT32_C(1) << (setup->stations[i] - 1);
	/* A server sends nothing of a tool that it does not see. */
	device = vrpn_device_new(request, sensors, INT64_MAX, false, err);
	if (!device)
		return NULL;
	device->tracker.ops = &ops;
	device->setup = *setup;
	incise_pace_init(&device->pace, device->haptic.info.rate_hz, INCISE_PACE_OFF, 1);
	return device;
}

INCISE_BACKEND(incise_tracker_vrpn, "tracker", "vrpn", .open = tracker_open);
