// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * Replies of a tracker under libFuzzer: the status S, numbers, fields and frames.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include "../../lib/device/polhemus/polhemus_dialogue.h"

static void wrong(const char *what)
{
	fprintf(stderr, "polhemus_status: %s\n", what);
	abort();
}

static void check_text(const char *text, size_t most)
{
	if (strlen(text) > most)
		wrong("a text longer than its place");
	for (; *text; text++)
		if (*text < ' ' || *text > '~')
			wrong("a text that cannot be printed");
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	struct polhemus_status status;
	struct polhemus_frame frame;
	double values[5];
	int fields[5], n;
	char *text = malloc(size + 1);
	/* Its size is the input's: the sanitizer watches its end. */
	unsigned char *copy = malloc(size ? size : 1);

	if (!text || !copy)
		abort();
	memcpy(copy, data, size);
	memcpy(text, data, size);
	text[size] = '\0';
	if (polhemus_status_read(copy, size, &status)) {
		check_text(status.version, 6);
		check_text(status.id, 32);
		if (status.station < 1 || status.station > 4 || status.sensors > 15 ||
		    abs(status.test_error) > 999)
			wrong("a status that cannot be");
	}
	n = polhemus_reply_numbers(text, values, 5);
	if (n > 5)
		wrong("too many numbers");
	for (int i = 0; i < n; i++)
		if (!(fabs(values[i]) <= 1e9))
			wrong("a number that is none");
	for (int width = 1; width <= 2; width++)
		if (polhemus_reply_fields(text, width, fields, 5) > 5)
			wrong("too many fields");
	if (polhemus_frame_read(copy, size, &frame) == 1 &&
	    (frame.payload + frame.n > copy + size || frame.length != frame.n + 8))
		wrong("a frame longer than its bytes");
	free(copy);
	free(text);
	return 0;
}
