// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Answers of chronyd and ptp4l, and a list of leap seconds, from anyone: no read beyond the bytes,
 * and each value that is taken is in its range.
 */
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include "../../lib/record/write/wall_packets.h"
#include "../../lib/record/write/wall_sources.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void check_chrony(const uint8_t *data, size_t size)
{
	struct incise_chrony_tracking t;

	if (!incise_chrony_read(&t, data, size, 7))
		return;
	if (size < INCISE_CHRONY_BYTES || t.ref_ns < 0 || !isfinite(t.correction_s) ||
	    !(t.delay_s >= 0 && isfinite(t.delay_s)) ||
	    !(t.dispersion_s >= 0 && isfinite(t.dispersion_s)) || !(t.skew_ppm >= 0))
		abort();
}

static void check_ptp(const uint8_t *data, size_t size)
{
	struct incise_ptp_state s = {0};

	if (!incise_ptp_read(&s, data, size, 0, 7))
		return;
	if (s.has_status && (s.ingress_ns < 0 || s.ingress_ns >= INT64_MAX / 2))
		abort();
	if (s.has_current && !(fabs(s.path_delay_ns) < 1e9))
		abort();
	if (s.has_properties && (s.utc_offset_s < 0 || s.utc_offset_s > 1000))
		abort();
}

static void check_list(const uint8_t *data, size_t size)
{
	char *text = malloc(size + 1);
	struct incise_leap_list list;

	memcpy(text, data, size);
	text[size] = 0;
	if (incise_leap_list_read(&list, text))
		for (int i = 0; i < list.n; i++)
			if (list.leaps[i].offset_s < 1 || list.leaps[i].offset_s > 1000 ||
			    (i && list.leaps[i].from_s <= list.leaps[i - 1].from_s))
				abort();
	free(text);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	uint8_t *copy = malloc(size ? size : 1); /* its end is the end of the memory */

	memcpy(copy, data, size);
	check_chrony(copy, size);
	check_ptp(copy, size);
	free(copy);
	check_list(data, size);
	return 0;
}
