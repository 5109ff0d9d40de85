// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Bytes of an OpenIGTLink server for the tracker under libFuzzer: whatever comes, samples are
 * finite, of unit length, in order of time and number.
 *
 *   input: size of the parts that arrive (1), ms between them (1), then bytes
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include "../../lib/device/igtl/igtl_poses.h"

static void wrong(const char *what)
{
	fprintf(stderr, "igtl_poses: %s\n", what);
	abort();
}

static void check(struct igtl_poses *poses, struct incise_tracker_sample *last,
		  int64_t t_ns)
{
	struct incise_tracker_sample s;

	while (incise_ring_take(&poses->ring, &s, 1) == 1) {
		double length = 0;

		for (int i = 0; i < 4; i++)
			length += s.quaternion[i] * s.quaternion[i];
		for (int i = 0; i < 3; i++)
			if (!(fabs(s.position_mm[i]) <= 1e6))
				wrong("a position that is none");
		if (!(fabs(length - 1) < 1e-9))
			wrong("a quaternion that is none");
		if (last->t_ns && (s.t_ns <= last->t_ns || s.seq <= last->seq))
			wrong("samples are not in order");
		/* Those of one packet are a nanosecond apart. */
		if (s.t_ns > t_ns + 100)
			wrong("a sample is later than its arrival");
		*last = s;
	}
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	static const struct incise_tracker_setup setup = {.repeat_ms = 100,
							  .offset_mm = {1, 2, 3}};
	struct incise_tracker_sample last = {0};
	struct igtl_poses poses;
	int64_t t_ns = 1000000000;
	size_t part;

	if (size < 2)
		return 0;
	if (igtl_poses_init(&poses, &setup, ""))
		abort();
	igtl_poses_start(&poses, 100);
	part = data[0] ? data[0] : 1;
	for (size_t at = 2; at < size; at += part) {
		size_t n = part < size - at ? part : size - at;

		t_ns += (data[1] + 1) * 1000000LL;
		if (igtl_poses_put(&poses, data + at, n, t_ns) == -EPROTO &&
		    igtl_poses_reconnected(&poses))
			abort();
		check(&poses, &last, t_ns);
	}
	if (!isfinite(igtl_poses_hz(&poses)))
		wrong("a rate that is none");
	igtl_poses_free(&poses);
	return 0;
}
