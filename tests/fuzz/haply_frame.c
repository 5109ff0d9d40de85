// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Bytes of an Inverse Service under libFuzzer, as a frame and as an event: whatever comes, numbers are
 * finite or NaN, quaternions of unit length, and texts are printable.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "../../lib/device/haply/haply_message.h"

static void wrong(const char *what)
{
	fprintf(stderr, "haply_frame: %s\n", what);
	abort();
}

static void check_text(const char *text, size_t size)
{
	if (strnlen(text, size) == size)
		wrong("a text has no end");
	for (; *text; text++)
		if ((unsigned char)*text < ' ' || *text == 0x7f)
			wrong("a text is not printable");
}

static void check_frame(const struct haply_frame *frame)
{
	const double *q = frame->quaternion;

	check_text(frame->id, sizeof(frame->id));
	check_text(frame->grip, sizeof(frame->grip));
	check_text(frame->ids, sizeof(frame->ids));
	check_text(frame->filters, sizeof(frame->filters));
	for (int i = 0; i < 3; i++) {
		if (fabs(frame->position_mm[i]) > 1e4 ||
		    fabs(frame->velocity_mm_s[i]) > 1e6)
			wrong("a position or velocity that is none");
		if (isnan(frame->position_mm[i]) && !frame->not_ready)
			wrong("a device without position is ready");
	}
	if (!(fabs(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3] - 1) < 0.02))
		wrong("a quaternion that is none");
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	struct haply_frame frame;
	char words[160] = "";

	if (!haply_frame_parse(&frame, (const char *)data, size, "", ""))
		check_frame(&frame);
	if (!haply_frame_parse(&frame, (const char *)data, size, "04B2", "8200"))
		check_frame(&frame);
	if (!haply_frame_parse(&frame, (const char *)data, size, "04B2", NULL))
		check_frame(&frame);
	haply_event_parse((const char *)data, size, "049D", "8200", words, sizeof(words));
	check_text(words, sizeof(words));
	return 0;
}
