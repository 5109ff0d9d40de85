// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The search for origins in any bytes: no read beyond them, an end, and each token that is found is
 * the same once it is written and read again.
 */
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <incise/origin.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	char *copy = malloc(size ? size : 1), text[INCISE_ORIGIN_TEXT];
	struct incise_origin origin, again;
	size_t at = 0, before = 0;

	memcpy(copy, data, size);
	while (incise_origin_next(copy, size, &at, &origin)) {
		size_t zero = 0;
		int n = incise_origin_text(&origin, text);

		if (at <= before || at > size || n <= 0 || n >= INCISE_ORIGIN_TEXT ||
		    (size_t)n != strlen(text) ||
		    !incise_origin_next(text, (size_t)n, &zero, &again) ||
		    zero != (size_t)n || strcmp(origin.name, again.name) ||
		    strcmp(origin.sha256, again.sha256) || origin.commit != again.commit)
			abort();
		before = at;
	}
	free(copy);
	return 0;
}
