// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * A factor (.fac) from another laboratory: input is a file without its checksum. What is accepted
 * is written again as the same bytes, adds up with nothing, and has a solution or an error.
 */
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <endian.h>
#include "../../lib/learn/factor.h"
#include "../../lib/base/crc32c.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	const struct incise_factor_ridge ridge = {1e-3, NAN};
	struct incise_error err = {0};
	char *bytes = malloc(size + 4);
	uint32_t crc = htole32(incise_crc32c(0, data, size));
	struct incise_train_report report;
	struct incise_factor *factor;
	struct incise_model *model;
	size_t again;
	void *written;

	if (size)
		memcpy(bytes, data, size);
	memcpy(bytes + size, &crc, sizeof(crc));
	factor = incise_factor_decode(bytes, size + 4, "input", &err);
	if (!factor && !err.code)
		abort();
	if (factor) {
		written = incise_factor_encode(factor, &again);
		/* Numbers may be written otherwise; what was written is read as the same. */
		free(bytes);
		bytes = written;
		incise_factor_free(factor);
		factor = incise_factor_decode(bytes, again, "again", &err);
		if (!factor)
			abort();
		size = again;
		written = incise_factor_encode(factor, &again);
		if (again != size || memcmp(written, bytes, size))
			abort();
		free(written);
		model = incise_factor_solve(factor, &ridge, &report, NULL, NULL, &err);
		incise_model_free(model);
	}
	incise_factor_free(factor);
	free(bytes);
	return 0;
}
