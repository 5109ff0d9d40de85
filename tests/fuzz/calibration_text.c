// SPDX-License-Identifier: GPL-2.0-or-later
/*
 * The text of a calibration.conf, as a recording holds it: what is accepted has values in their
 * ranges, and a history that a budget of uncertainties can be made of.
 */
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <incise/calibration.h>

static void check(const struct incise_calibration_record *record)
{
	int n = record->n;

	if (n < 1 || n > INCISE_CALIBRATION_VALUES ||
	    (record->n_covariance && record->n_covariance != n * (n + 1) / 2))
		abort();
	for (int i = 0; i < n; i++)
		if (!isfinite(record->values[i].left) || !isfinite(record->values[i].u) ||
		    record->values[i].u < 0)
			abort();
	for (int i = 0; i < record->n_covariance; i++)
		if (!isfinite(record->covariance[i]))
			abort();
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
	struct incise_calibration_record *records;
	struct incise_calibration calibration;
	struct incise_error err = {0};
	char *text = malloc(size + 1);
	int n;

	if (size)
		memcpy(text, data, size);
	text[size] = '\0';
	n = incise_calibration_text(text, "input", &calibration, &records, &err);
	if (n < 0 && (!err.code || records))
		abort();
	for (int i = 0; i < n; i++)
		check(&records[i]);
	if (n >= 0 && !(calibration.force_mV_N >= 1 && calibration.force_mV_N <= 1e5 &&
			!(calibration.surface_u_mm < 0)))
		abort();
	free(records);
	free(text);
	return 0;
}
